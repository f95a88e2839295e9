// The search page: the sections that have all words, those with the words in their titles first, then sections with some of the
// words, each with the place where a word stands.  Words of grammar and of asking, "what is the", are no words here.
const WORD = /[\p{L}\p{N}_]+/gu;
const SHOWN = 30, AROUND = 110;
const FEW = 10;  // sections with all the words, below which those with some of them follow
const english = new Stemmer();  // Sphinx's, as `stopwords` are, of language_data.js
const ASKING = "what how why when where which who whose do does did can could should would i me my we our you your have has had am from than so "
  + "и в во на с со по для не из от о об к ко или при что как это где когда почему какой какая какие чем";
const SILENT = new Set([...stopwords, ...ASKING.split(" ")]);
const LESS = { package: 0.3, manual: 0.5, "sample-report.html": 0.4, "reference/glossary.html": 0.7 };  // than a chapter
const worth = (address) => Object.entries(LESS).find(([page]) => address.startsWith(page))?.[1] ?? 1;

// A word without its ending: "errors" finds "error", "ошибки" finds "ошибка", "фильтрации" finds "фильтрация".
function stem(word) {
  word = word.toLowerCase().replace("ё", "е");
  if (/^[a-z]+$/.test(word)) return english.stemWord(word);
  return /^[а-я]{5,}$/.test(word) ? word.replace(/[аеиоуыэюяйьмхвс]{1,3}$/, "") : word;
}

const index = new MiniSearch({
  fields: ["page", "section", "text"],
  tokenize: (text) => text.match(WORD) || [],
  processTerm: (word) => !SILENT.has(word.toLowerCase()) && stem(word),
  searchOptions: { boost: { page: 3, section: 4 }, prefix: (term) => term.length > 3, boostDocument: (id) => worth(SECTIONS[id][0]) },
});
index.addAll(SECTIONS.map(([, page, section, text], id) => ({ id, page, section, text })));

const stemsOf = (text) => (text.match(WORD) || []).filter((word) => !SILENT.has(word.toLowerCase())).map(stem);
// Abbreviations, of the glossary's terms: "EKF" also finds "extended Kalman filter".
const LONG = new Map();
for (const [, , section] of SECTIONS) {
  const [, long, short] = section.match(/^([\w' -]+) \(([A-Z0-9]{2,})\)/) ?? [];
  if (short) LONG.set(stem(short), long);
}

// The text around the place with the most of the words, which are marked.
function excerpt(text, stems) {
  const places = [...text.matchAll(WORD)].filter(([word]) => stems.some((one) => stem(word).startsWith(one)));
  const near = (place) => new Set(places.filter(({ index: at }) => Math.abs(at - place.index) < AROUND).map(([word]) => stem(word))).size;
  const best = places.reduce((one, other) => (near(other) > near(one) ? other : one), places[0]);
  const first = best ? Math.max(0, text.lastIndexOf(" ", best.index - AROUND) + 1) : 0;
  const last = (best?.index ?? 0) + 2 * AROUND;
  const box = document.createElement("p");
  let at = first;
  box.append(first ? "… " : "");
  for (const { 0: word, index: start } of places.filter((place) => place.index >= first && place.index < last)) {
    const mark = document.createElement("mark");
    mark.textContent = word;
    box.append(text.slice(at, start), mark);
    at = start + word.length;
  }
  const end = last < text.length ? text.lastIndexOf(" ", last) : text.length;
  box.append(text.slice(at, Math.max(at, end)), end < text.length ? " …" : "");
  return box;
}

function show(query) {
  const stems = stemsOf(query), queries = stems.map((one) => {
    const long = LONG.get(one);
    return long ? { combineWith: "OR", queries: [one, { combineWith: "AND", queries: [long] }] } : one;
  });
  const titled = ({ id }) => {
    const [address, page, section] = SECTIONS[id], words = stemsOf(section || page);
    const there = (all) => all.every((one) => words.some((word) => word.startsWith(one)));
    return worth(address) > 0.5 && stems.every((one) => there([one]) || (LONG.has(one) && there(stemsOf(LONG.get(one))))) && (section ? 1 : 2);
  };
  const all = stems.length ? index.search({ combineWith: "AND", queries }).sort((a, b) => titled(b) - titled(a)) : [];
  const some = all.length >= FEW ? [] : index.search({ combineWith: "OR", queries }).filter(({ id }) => !all.some((one) => one.id === id));
  const found = [...all, ...some];
  const rows = found.slice(0, SHOWN).map(({ id }) => {
    const [address, page, section, text] = SECTIONS[id];
    const [path, anchor] = address.split("#");
    const row = document.createElement("li"), link = document.createElement("a");
    link.href = `${path}?highlight=${encodeURIComponent(query)}${anchor ? `#${anchor}` : ""}`;
    link.textContent = section ? `${page} › ${section}` : page;
    row.append(link, excerpt(text, stems));
    return row;
  });
  document.getElementById("search-results").replaceChildren(...rows);
  const many = `${found.length} section${found.length === 1 ? "" : "s"}${found.length > SHOWN ? `, the best ${SHOWN} of them` : ""}`;
  const missing = some.length && stems.length > 1 ? `, ${all.length || "none"} with all the words` : "";
  document.getElementById("kf-found").textContent = !stems.length ? "" : found.length ? many + missing : "Nothing found: try fewer words, or their beginnings.";
}

addEventListener("DOMContentLoaded", () => {
  const query = new URLSearchParams(location.search).get("q") || "";
  for (const field of document.querySelectorAll("form.bd-search input")) field.value = query;
  document.querySelector(".bd-search-container form.bd-search input").focus();
  show(query);
});
