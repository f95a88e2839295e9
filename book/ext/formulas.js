// node formulas.js FOLDER: sets formulas with MathJax of that folder.  A line in, a line out, both JSON: [TeX, display] becomes
// {html} or {error}; null becomes {css}, the rules of all that was set.
const [, , folder] = process.argv;
const SPARE = / (?:data-mjx-texclass|texclass|xmlns|unselectable|style|class)="(?:[A-Z]+|http[^"]*|on|position: relative;|mjx-[in])"/g; // no rule asks for it
const BARE = /<(mjx-m(?:[ion]|style))>((?:<mjx-(c|mspace)[^>]*><\/mjx-\3>)+)<\/\1>/g; // a box around boxes that changes none of them

function answer(MathJax, asked) {
  const tree = MathJax.startup.adaptor;
  if (asked === null) return { css: tree.textContent(MathJax.chtmlStylesheet()) };
  try {
    const [tex, display] = asked;
    return { html: tree.outerHTML(MathJax.tex2chtml(tex, { display })).replace(SPARE, "").replace(BARE, "$2") };
  } catch (error) {
    return { error: error.message };
  }
}

require(`${folder}/node-main.js`)
  .init({
    loader: {
      paths: { mathjax: folder },
      load: ["adaptors/liteDOM", "input/tex-base", "[tex]/ams", "output/chtml", "a11y/assistive-mml"],
      versionWarnings: false,
    },
    tex: { packages: ["base", "ams"], formatError: (_, error) => { throw error; } },
    chtml: { matchFontHeight: false, fontURL: "fonts" },
  })
  .then((MathJax) => {
    const lines = require("node:readline").createInterface({ input: process.stdin });
    lines.on("line", (line) => console.log(JSON.stringify(answer(MathJax, JSON.parse(line)))));
  });
