// Figures that answer: axes, curves, bands, handles that a mouse, a finger or the arrow keys move, sliders, a worker, and the state
// in the address, so that a link keeps it.  A figure begins as the still picture that its cell draws; this takes its place when the
// first frame is computed, and gives it back to paper.  Nothing moves unless the reader moves it.  Sizes are CSS pixels: text stays as
// large as it is when the screen is small.
//
//   kfFigure(root, name, defaults, (ui) => { ...; return (state) => { draw } });

globalThis.kfFigure ??= (() => {
  // The picture's own; the dark theme turns them with its pictures.
  const INK = "#1f2328", LINE = "#d0d7de", BLUE = "#0072B2", BAND = "#56B4E9", ORANGE = "#D55E00";
  const SVG = "http://www.w3.org/2000/svg";
  const make = (tag, attributes = {}, parent = null, text = null) => {
    const one = tag.startsWith("svg:") ? document.createElementNS(SVG, tag.slice(4)) : document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) one.setAttribute(name, value);
    if (text !== null) one.textContent = text;
    parent?.append(one);
    return one;
  };
  const clip = (value, low, high) => Math.min(Math.max(value, low), high);
  const short = (value) => {  // a number as people write it, with the true minus, and powers of ten
    const size = Math.abs(value);
    if (size >= 1e-3 && size < 1e5 || size === 0) return String(Number(value.toPrecision(3))).replace("-", "−");
    const [digits, power] = value.toExponential(2).split("e"), part = Number(digits);
    const raised = [...String(Number(power))].map((one) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(one)]).join("");
    return `${part === 1 ? "" : `${part}·`.replace("-", "−")}10${raised}`;
  };

  const STYLE = `
.kf-explore { font: .93rem/1.4 var(--sans, system-ui, sans-serif); font-variant-numeric: tabular-nums lining-nums; color: var(--ink, CanvasText); }
.kf-explore * { box-sizing: border-box; }
.kf-explore .kf-charts { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, var(--kf-least, 17rem)), 1fr)); gap: .4rem 1rem; }
.kf-explore svg.kf-chart { display: block; width: 100%; overflow: visible; filter: var(--picture, none); user-select: none; -webkit-user-select: none; }
.kf-explore svg text { font: 400 13px var(--sans, system-ui, sans-serif); fill: ${INK}; }
.kf-explore .kf-handle { cursor: grab; touch-action: none; outline: none; }
.kf-explore .kf-handle:active { cursor: grabbing; }
.kf-explore .kf-handle:focus-visible circle:last-child { stroke: ${INK}; stroke-width: 4px; }
.kf-explore .kf-controls { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 9.5rem), 1fr)); gap: .35rem 1.2rem; margin: .5rem 0; }
.kf-explore label { display: grid; grid-template-columns: 1fr auto; align-items: baseline; column-gap: .6rem; margin: 0; }
.kf-explore label input, .kf-explore label select { grid-column: 1 / -1; width: 100%; margin: 0; accent-color: var(--accent, auto); min-height: 1.5rem; }
.kf-explore label:has(select) { grid-column: span 2; }
.kf-explore select { font: inherit; color: inherit; background: var(--paper, Canvas); border: 1px solid var(--soft, GrayText); border-radius: 4px; padding: .15rem .3rem; }
button.kf-try { font: inherit; color: var(--accent, LinkText); background: none; border: 1px solid currentcolor; border-radius: 4px; padding: 0 .5rem; }
.kf-explore .kf-keys { display: flex; flex-wrap: wrap; gap: .1rem 1rem; list-style: none; padding: 0; margin: .3rem 0; }
.kf-explore .kf-keys li { margin: 0; } .kf-explore .kf-keys svg { filter: var(--picture, none); margin-right: .35rem; }
.kf-explore p.kf-says { margin: .3rem 0; min-height: 1.4em; }
.kf-explore.kf-old :is(.kf-charts, .kf-numbers) { opacity: .35; }
@media screen { .kf-still { display: none !important; } }
@media print { .kf-explore { display: none !important; } }`;

  // ------------------------------------------------------------------ scales and axes

  const scale = (log) => {
    const to = log ? Math.log10 : (value) => value;
    const one = { low: 0, high: 1, from: 0, until: 1 };
    one.at = (value) => one.from + ((to(value) - to(one.low)) / (to(one.high) - to(one.low))) * (one.until - one.from);
    one.value = (place) => {
      const t = to(one.low) + ((place - one.from) / (one.until - one.from)) * (to(one.high) - to(one.low));
      return log ? 10 ** t : t;
    };
    one.ticks = (count) => {
      if (log) {
        const decades = Math.log10(one.high / one.low), every = Math.ceil(decades / count), found = [];
        for (let d = Math.ceil(Math.log10(one.low) - 1e-9); 10 ** d <= one.high * (1 + 1e-9); d += every) found.push(10 ** d);
        return found.length > 1 ? found : [one.low, one.high];
      }
      const rough = (one.high - one.low) / count, power = 10 ** Math.floor(Math.log10(rough));
      const step = [1, 2, 5, 10].find((m) => m * power >= rough) * power, found = [];
      for (let i = Math.ceil(one.low / step - 1e-9); i * step <= one.high + 1e-9 * step; i++) found.push(i * step);
      return found;
    };
    return one;
  };

  // A chart: axes with labels (and `ticks`, if they are not round numbers: pairs of value and text), and what is drawn on them;
  // `says` is what it shows to those who cannot see it.
  const chart = (ui, parent, { height = 250, x, y, title = "", says, left = 52 }) => {
    const svg = make("svg:svg", { class: "kf-chart", height, role: "group", "aria-label": says }, parent);
    const top = title ? 26 : 10, bottom = 42, right = 12;
    const mask = `${ui.name}-mask-${ui.charts.length}`;
    const rectangle = make("svg:rect", {}, make("svg:clipPath", { id: mask }, make("svg:defs", {}, svg)));
    const axes = make("svg:g", { "aria-hidden": "true" }, svg), inside = make("svg:g", { "clip-path": `url(#${mask})` }, svg);
    const above = make("svg:g", {}, svg);
    const sx = scale(x.log), sy = scale(y.log), parts = [];
    const limits = (of, [low, high]) => Object.assign(of, { low, high });
    limits(sx, x.range ?? [0, 1]);
    limits(sy, y.range ?? (y.log ? [0.1, 1] : [0, 1]));
    const draw = () => {
      const width = svg.clientWidth || 600;
      svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
      Object.assign(sx, { from: left, until: width - right });
      Object.assign(sy, { from: height - bottom, until: top });
      for (const [name, value] of [["x", left], ["y", top - 1], ["width", width - left - right + 1], ["height", height - top - bottom + 2]])
        rectangle.setAttribute(name, value);
      axes.replaceChildren();
      const marks = (axis, of, count) => axis.ticks ?? of.ticks(count).map((tick) => [tick, short(tick)]);
      for (const [tick, label] of marks(x, sx, Math.max(3, Math.floor(width / 70)))) {
        make("svg:path", { d: `M${sx.at(tick)} ${sy.from}v5`, stroke: INK }, axes);
        make("svg:path", { d: `M${sx.at(tick)} ${sy.from}V${top}`, stroke: LINE, "stroke-width": 0.6 }, axes);
        make("svg:text", { x: sx.at(tick), y: sy.from + 18, "text-anchor": "middle" }, axes, label);
      }
      for (const [tick, label] of marks(y, sy, Math.max(2, Math.floor(height / 50)))) {
        make("svg:path", { d: `M${left} ${sy.at(tick)}h-5`, stroke: INK }, axes);
        make("svg:path", { d: `M${left} ${sy.at(tick)}H${width - right}`, stroke: LINE, "stroke-width": 0.6 }, axes);
        make("svg:text", { x: left - 8, y: sy.at(tick) + 4.5, "text-anchor": "end" }, axes, label);
      }
      make("svg:path", { d: `M${left} ${top}V${sy.from}H${width - right}`, fill: "none", stroke: INK, "stroke-width": 0.8 }, axes);
      make("svg:text", { x: (left + width - right) / 2, y: height - 5, "text-anchor": "middle" }, axes, x.label);
      make("svg:text", { x: 13, y: (top + sy.from) / 2, "text-anchor": "middle", transform: `rotate(-90 13 ${(top + sy.from) / 2})` }, axes, y.label);
      if (title) make("svg:text", { x: left, y: 15, style: "font-weight: 600" }, axes, title);
      for (const part of parts) part();
    };
    // A line over points; a number that is none breaks it.
    const points = (xs, ys) => {
      let path = "", pen = "M";
      for (let i = 0; i < xs.length; i++) {
        const [px, py] = [sx.at(xs[i]), clip(sy.at(ys[i]), -1e4, 1e4)];
        path += isFinite(px) && isFinite(py) ? `${pen}${px.toFixed(1)} ${py.toFixed(1)}` : "";
        pen = isFinite(px) && isFinite(py) ? "L" : "M";
      }
      return path;
    };
    const shape = (attributes, path) => {
      const one = make("svg:path", attributes, inside);
      let given = null;
      parts.push(() => given && one.setAttribute("d", path(...given)));
      return (...values) => { given = values; };
    };
    const curve = ({ colour = INK, width = 1.8, dash = "" } = {}) =>
      shape({ fill: "none", stroke: colour, "stroke-width": width, "stroke-dasharray": dash, "stroke-linejoin": "round" }, points);
    const band = ({ colour = INK, opacity = 0.18 } = {}) =>
      shape({ fill: colour, "fill-opacity": opacity, stroke: "none" }, (xs, low, high) => {
        const kept = [...xs.keys()].filter((i) => isFinite(low[i]) && isFinite(high[i])), back = [...kept].reverse();
        if (kept.length < 2) return "";
        return `${points(kept.map((i) => xs[i]), kept.map((i) => high[i]))}${points(back.map((i) => xs[i]), back.map((i) => low[i])).replace("M", "L")}Z`;
      });
    const dots = ({ colour = INK, size = 3 } = {}) => shape({ fill: colour }, (xs, ys) => Array.from(xs, (x, i) =>
      isFinite(ys[i]) ? `M${sx.at(x) - size} ${sy.at(ys[i])}a${size} ${size} 0 1 0 ${2 * size} 0a${size} ${size} 0 1 0 ${-2 * size} 0Z` : "").join(""));
    const text = ({ colour = INK, anchor = "start" } = {}) => {
      const one = make("svg:text", { style: `fill: ${colour}`, "text-anchor": anchor, "aria-hidden": "true" }, above);
      let given = null;
      parts.push(() => {
        if (!given) return;
        one.setAttribute("x", sx.at(given[0]));
        one.setAttribute("y", sy.at(given[1]));
        one.textContent = given[2];
      });
      return (...values) => { given = values; };
    };

    // A handle moves the entries `keys` of the state, {x: key} or {y: key} or both, each within `range`, by `step` with an arrow key.
    // `place(state)` is where it stands, `name` what is moved, `value(state)` how its value is said.
    const handle = ({ keys, range, step, colour = ORANGE, place, name, value }) => {
      const one = make("svg:g", { class: "kf-handle", tabindex: 0, role: "slider", "aria-label": name }, above);
      make("svg:circle", { r: 22, fill: "transparent" }, one);
      make("svg:circle", { r: 7.5, fill: "#ffffff", stroke: colour, "stroke-width": 3 }, one);
      const put = (axis, to) => {
        if (keys[axis] === undefined) return {};
        const key = keys[axis], [low, high] = range[axis];
        return { [key]: Number(clip(Math.round(to / step[axis]) * step[axis], low, high).toPrecision(12)) };
      };
      const toPointer = (event) => {
        const box = svg.getBoundingClientRect();
        ui.set({ ...put("x", sx.value(event.clientX - box.left)), ...put("y", sy.value(event.clientY - box.top)) });
      };
      one.addEventListener("pointerdown", (event) => {
        one.setPointerCapture(event.pointerId);
        one.focus({ preventScroll: true });
        event.preventDefault();
      });
      one.addEventListener("pointermove", (event) => one.hasPointerCapture(event.pointerId) && toPointer(event));
      const main = keys.x === undefined ? "y" : "x";
      const KEYS = { ArrowRight: ["x", 1], ArrowLeft: ["x", -1], ArrowUp: ["y", 1], ArrowDown: ["y", -1], PageUp: [main, 10], PageDown: [main, -10] };
      one.addEventListener("keydown", (event) => {
        const ends = { Home: 0, End: 1 };
        let [axis, count] = KEYS[event.key] ?? [main, 0];
        if (!(event.key in KEYS) && !(event.key in ends)) return;
        if (keys[axis] === undefined) axis = main;
        event.preventDefault();
        ui.set(put(axis, event.key in ends ? range[axis][ends[event.key]] : ui.state[keys[axis]] + count * (event.shiftKey ? 10 : 1) * step[axis]));
      });
      parts.push(() => {
        const [px, py] = place(ui.state);
        one.setAttribute("transform", `translate(${sx.at(px)} ${sy.at(py)})`);
        for (const [what, said] of [["now", ui.state[keys[main]]], ["min", range[main][0]], ["max", range[main][1]], ["text", value(ui.state)]])
          one.setAttribute(`aria-value${what}`, said);
      });
    };
    const one = { draw, curve, band, dots, text, handle, x: (range) => limits(sx, range), y: (range) => limits(sy, range) };
    ui.charts.push(one);
    return one;
  };

  // ------------------------------------------------------------------ controls

  const listen = (ui, within, show) => ui.shown.push(Object.assign(show, { within }));

  const slider = (ui, parent, key, { label, low, high, step, log = false, say = short }) => {
    const box = make("label", {}, parent);
    make("span", {}, box, label);
    const shown = make("span", { "aria-hidden": "true" }, box);
    const ends = log ? { min: Math.log10(low), max: Math.log10(high), step: 0.02 } : { min: low, max: high, step };
    const input = make("input", { type: "range", ...ends, "aria-label": label }, box);
    input.addEventListener("input", () =>
      ui.set({ [key]: log ? Number((10 ** Number(input.value)).toPrecision(3)) : Number(Number(input.value).toPrecision(12)) }));
    listen(ui, parent, (state) => {
      if (!(state[key] >= low && state[key] <= high)) state[key] = clip(state[key], low, high);
      input.value = log ? Math.log10(state[key]) : state[key];
      shown.textContent = say(state[key]);
      input.setAttribute("aria-valuetext", shown.textContent);
    });
  };

  const choice = (ui, parent, key, { label, options }) => {
    const box = make("label", {}, parent);
    make("span", {}, box, label);
    const input = make("select", { "aria-label": label }, box);
    for (const [value, text] of options) make("option", { value }, input, text);
    input.addEventListener("change", () => ui.set({ [key]: input.value }));
    listen(ui, parent, (state) => { input.value = state[key]; });
  };

  const legend = (parent, lines) => {
    const list = make("ul", { class: "kf-keys" }, parent);
    for (const { label, colour, dash = "", opacity = 1, width = 2 } of lines) {
      const item = make("li", {}, list), svg = make("svg:svg", { width: 26, height: 10, "aria-hidden": "true" }, item);
      make("svg:path", { d: "M1 5H25", stroke: colour, "stroke-width": width, "stroke-dasharray": dash, "stroke-opacity": opacity }, svg);
      item.append(label);
    }
  };

  // A worker from text, which needs no server: from a file a browser makes none but from a blob.  It is sent the last question only.
  const worker = (source, answered) => {
    const address = URL.createObjectURL(new Blob([source], { type: "text/javascript" })), one = new Worker(address);
    let number = 0;
    one.addEventListener("message", ({ data }) => data.number === number && answered(data));
    return (question) => one.postMessage({ ...question, number: ++number });
  };

  // ------------------------------------------------------------------ a figure

  const parse = (text, defaults) => {  // of each entry the kind of its default
    const found = {};
    for (const [key, given] of new URLSearchParams(text)) {
      const value = typeof defaults[key] === "number" ? Number(given) : given;
      if (key in defaults && given !== "" && value === value) found[key] = value;
    }
    return found;
  };
  const read = (name, defaults) => {  // what the address says of this figure
    const [before, after = ""] = decodeURIComponent(location.hash.slice(1)).split("?");
    return before === name ? parse(after, defaults) : null;
  };

  // What a printed loop writes into `value`, for arrays of its arguments and its coefficients.
  const values = (loop, arrays, c = {}) => {
    const a = { ...arrays, value: new Float64Array(Object.values(arrays)[0].length) };
    loop(a.value.length, {}, c, a);
    return a.value;
  };

  return Object.assign((root, name, defaults, build) => {
    const styled = "kf-explore-style";
    if (!document.getElementById(styled)) make("style", { id: styled }, document.head, STYLE);
    const state = { ...defaults, ...read(name, defaults) };
    const code = root.parentElement.querySelector("script.kf-code")?.textContent;
    const ui = { root, name, state, code, charts: [], shown: [], worker, make: (tag, attributes, text) => make(tag, attributes, root, text) };
    let pending = 0, draw = null;
    const compute = () => {
      for (const show of ui.shown) show(state);
      draw(state);
    };
    const paint = () => { for (const one of ui.charts) one.draw(); };
    const redraw = () => {
      compute();
      paint();
    };
    const keep = () => {
      const changed = Object.entries(state).filter(([key, value]) => key in defaults && value !== defaults[key]);
      history.replaceState(history.state, "", `#${name}${changed.length ? `?${new URLSearchParams(changed)}` : ""}`);
    };
    ui.set = (change) => {
      Object.assign(state, change);
      redraw();
      clearTimeout(pending);
      pending = setTimeout(keep, 300);  // browsers refuse an address that changes a hundred times a second
    };
    ui.row = (kind = "kf-controls") => make("div", { class: kind }, root);
    ui.chart = (parent, of) => chart(ui, parent, of);
    ui.slider = (parent, key, of) => slider(ui, parent, key, of);
    ui.choice = (parent, key, of) => choice(ui, parent, key, of);
    ui.legend = (lines, parent = root) => legend(parent, lines);
    ui.short = short;
    ui.says = () => make("p", { class: "kf-says", role: "status" }, root);
    ui.redraw = redraw;
    ui.clear = (parent) => {
      parent.replaceChildren();
      ui.shown = ui.shown.filter((show) => show.within !== parent);
    };
    draw = build(ui);
    compute();
    // The still picture of the same cell makes room on the screen, and stays for paper.
    const still = document.getElementById(name)?.querySelector("img, [role=img]");
    if (still) {
      still.classList.add("kf-still");
      still.after(root);
    }
    paint();
    new ResizeObserver(paint).observe(root);
    addEventListener("hashchange", () => {
      const given = read(name, defaults);
      if (given) ui.set({ ...defaults, ...given });
    });
    // What a sentence of the page tells to try, and what a link leads to: below, where the page may not be read yet.  The figure
    // itself does not wait for that, or what stands under it would move when it comes.
    const rest = () => {
      for (const one of document.querySelectorAll(`button[data-figure="${name}"]`))
        one.addEventListener("click", () => {
          ui.set({ ...defaults, ...parse(one.dataset.state, defaults) });
          root.scrollIntoView();
        });
      if (read(name, defaults) && location.hash.includes("?")) root.scrollIntoView();
      root.dataset.ready = "";
    };
    document.readyState === "loading" ? addEventListener("DOMContentLoaded", rest) : rest();
    return ui;
  }, { values, INK, BLUE, BAND, ORANGE });
})();
