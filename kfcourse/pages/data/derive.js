// "Derive it": the checker of kfcourse.exercises.derivations for a page without a server and without Python.  The same trees, the same
// search for slips; equality by values at random points, means by Gauss-Hermite quadrature.  tests/pages/test_derive.py holds
// its verdicts against the package's.
(function () {
  "use strict";

  const FUNCTIONS = {
    sin: Math.sin, cos: Math.cos, tan: Math.tan, atan: Math.atan, exp: Math.exp, log: Math.log, sinh: Math.sinh, cosh: Math.cosh,
    tanh: Math.tanh, abs: Math.abs,
  };
  const ENTIRE = ["exp", "sin", "cos", "sinh", "cosh"];
  const MEANS = ["M", "D", "Cov"];
  const ROUNDING = 1e-10, CLEAR = 1e-4, CLOSE = 1e-7, TRIED = 18, FEWEST = 4, MOST_TRIED = 30000, SECONDS = 3;
  const LONGEST = 600, DEEPEST = 60, MAX_LENGTH = 2000, MAX_EXPONENT = 16, MOST_LINES = 400;
  const FORGOTTEN = "noise-forgotten";
  const COSTS = {
    sign: 1, doubled: 1.05, letter: 1.1, moment: 1.25, power: 1.2, factor: 1.2, [FORGOTTEN]: 1.22,
    "lost-factor": 1.3, extra: 1.4, lost: 1.5,
  };
  const NUMBERS = [-1, 2, 3, 4, 5, 6, 1 / 2, 3 / 2, 5 / 2, 1 / 3, 2 / 3, 4 / 3, 5 / 3, 1 / 4, 3 / 4, 5 / 4, 1 / 5, 2 / 5, 3 / 5, 4 / 5, 6 / 5, 1 / 6, 5 / 6];
  const POWERS = [1, 2, 3, 4, 0.5, -1, -2], OF_THE_LINE_ABOVE = 1;
  const OF_FILTERS = ["y", "K", "R", "lambda", "Psi", "m", "d", "z", "p", "tau", "Theta", "h", "G", "F"];

  class Unreadable extends Error {
    constructor(problem, column) { super(problem); this.column = column; }
  }
  class Uncomputed extends Error {}
  class DerivationError extends Error {}

  // ---------------------------------------------------------------- trees

  const make = (kind, parts = [], data = null, span = null) => ({ kind, parts, data, span });
  const number = (value) => make("number", [], value);
  const letter = (name) => make("letter", [], name);
  const total = (parts, signs) => make("sum", parts, signs || parts.map(() => 1));
  const product = (parts, exponents) => make("product", parts, exponents || parts.map(() => 1));
  const power = (base, exponent) => make("power", [base], exponent);
  const mean = (of) => make("mean", [of]);
  const minus = (a, b) => total([a, b], [1, -1]);
  const at = (node, path) => path.reduce((one, i) => one.parts[i], node);

  function walk(node, path = [], found = []) {
    found.push([path, node]);
    node.parts.forEach((part, i) => walk(part, [...path, i], found));
    return found;
  }

  function changed(node, path, other) {
    if (!path.length) return other;
    const parts = node.parts.slice();
    parts[path[0]] = changed(parts[path[0]], path.slice(1), other);
    return { ...node, parts };
  }

  const letters = (node) => new Set(walk(node).filter(([, one]) => one.kind === "letter").map(([, one]) => one.data));

  function replaced(node, names) {
    if (node.kind === "letter") return names[node.data] || node;
    return node.parts.length ? { ...node, parts: node.parts.map((part) => replaced(part, names)) } : node;
  }

  function derivative(node, name) {
    const of = (one) => derivative(one, name);
    if (node.kind === "number") return number(0);
    if (node.kind === "letter") return number(node.data === name ? 1 : 0);
    if (node.kind === "sum") return total(node.parts.map(of), node.data);
    if (node.kind === "product") {
      return total(node.parts.map((part, i) => {
        const rest = node.parts.slice(), data = node.data.slice();
        rest[i] = of(part);
        if (data[i] > 0) return product(rest, data);
        return product([number(-1), ...rest, part, part], [1, ...data.map((e, j) => (j === i ? 1 : e)), -1, -1]);
      }));
    }
    const inner = node.parts[0];
    if (node.kind === "power") return product([number(node.data), power(inner, node.data - 1), of(inner)]);
    const outer = {
      sin: () => make("call", [inner], "cos"), cos: () => product([number(-1), make("call", [inner], "sin")]),
      exp: () => node, log: () => power(inner, -1), sinh: () => make("call", [inner], "cosh"),
      cosh: () => make("call", [inner], "sinh"), tan: () => power(make("call", [inner], "cos"), -2),
      tanh: () => power(make("call", [inner], "cosh"), -2), atan: () => power(total([number(1), power(inner, 2)]), -1),
    }[node.data];
    if (!outer) throw new DerivationError(`the derivative of ${node.data} is not formed here; take another function`);
    return product([outer(), of(inner)]);
  }

  // ---------------------------------------------------------------- reading

  function readLine(text, known = () => null) {
    if (!text.trim()) throw new Unreadable("the formula is empty", 0);
    if (text.length > MAX_LENGTH) throw new Unreadable(`the formula has ${text.length} characters; at most ${MAX_LENGTH} are read`, 0);
    const tokens = [], pattern = /\s+|(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)|([A-Za-z][A-Za-z0-9_]*)|(\*\*|[-+*/^()[\],])/y;
    while (pattern.lastIndex < text.length) {
      const start = pattern.lastIndex, found = pattern.exec(text);
      if (!found) {
        const looks = "aceopxyABCEHKMOPTX"["асеорхуАВСЕНКМОРТХ".indexOf(text[start])], cyrillic = /\p{Script=Cyrillic}/u.test(text[start]);
        throw new Unreadable(`${text[start]}${cyrillic ? " (a Cyrillic letter)" : ""} has no meaning in a formula${looks ? `; write ${looks} of the English keyboard` : ""}`, start);
      }
      const kind = found[1] ? "number" : found[2] ? "name" : found[3] ? "sign" : "";
      if (kind) tokens.push({ kind, text: found[0] === "**" ? "^" : found[0], start, end: pattern.lastIndex });
    }
    if (tokens.length > 4 * LONGEST) throw new Unreadable(`the line has more than ${LONGEST} numbers, letters and signs; split the step up`, 0);
    let place = 0, depth = 0, count = 0;
    const next = () => tokens[place];
    const is = (sign) => next() && next().kind === "sign" && next().text === sign;
    const wrong = (problem, token) => new Unreadable(problem, token ? token.start : text.length);

    function take(sign) {
      if (is(sign)) return tokens[place++];
      const here = next();
      throw wrong(here ? `${sign} is expected here; a product needs *, as in 2*x` : `the line ends where ${sign} is expected`, here);
    }

    function counted(node, start, end) {
      if (++count > LONGEST) throw new Unreadable(`the line has more than ${LONGEST} numbers, letters and signs; split the step up`, start);
      node = { ...node, span: [start, end] };
      node.parts = node.parts.map((part) => (part.span ? part : { ...part, span: node.span }));
      return node;
    }

    function nested(read) {
      if (++depth > DEEPEST) throw wrong(`brackets stand one in the other more than ${DEEPEST} deep; split the step up`, next());
      const found = read();
      depth--;
      return found;
    }

    // a reader gives [node, start, end]: brackets belong to the place, not to the node
    function sum() {
      const first = term(), parts = [first[0]], signs = [1];
      let [node, start, end] = first;
      if (node.kind === "sum" && node.parts.length === 1 && !first.bracket) { signs[0] = node.data[0]; parts[0] = node.parts[0]; }
      if (!is("+") && !is("-")) return first;
      while (is("+") || is("-")) {
        let sign = tokens[place++].text === "+" ? 1 : -1;
        const [one, , to] = term();
        let part = one;
        if (part.kind === "sum" && part.parts.length === 1) { sign *= part.data[0]; part = part.parts[0]; }
        parts.push(part);
        signs.push(sign);
        end = to;
      }
      return [counted(total(parts, signs), start, end), start, end];
    }

    function term() {
      const first = signed();
      if (!is("*") && !is("/")) return first;
      let [node, start, end] = first, negative = false;
      if (node.kind === "sum" && node.parts.length === 1) { negative = node.data[0] < 0; node = node.parts[0]; }
      const parts = [node], exponents = [1];
      while (is("*") || is("/")) {
        exponents.push(tokens[place++].text === "*" ? 1 : -1);
        const [one, , to] = signed();
        parts.push(one);
        end = to;
      }
      node = counted(product(parts, exponents), start, end);
      return [negative ? counted(total([node], [-1]), start, end) : node, start, end];
    }

    function signed() {
      if (is("+")) { place++; return nested(signed); }
      if (is("-")) {
        const { start } = tokens[place++], [node, , end] = nested(signed);
        return [counted(total([node], [-1]), start, end), start, end];
      }
      return raised();
    }

    function raised() {
      const [base, start, end] = atom();
      if (!is("^")) return [base, start, end];
      const sign = tokens[place++], [above, , to] = nested(signed), exponent = constant(above);
      if (exponent === null) throw wrong("an exponent must be a plain number; write exp(...) for exponentials", tokens[tokens.indexOf(sign) + 1]);
      if (Math.abs(exponent) > MAX_EXPONENT) throw wrong(`the exponent is larger than ${MAX_EXPONENT}`, sign);
      return [counted(power(base, exponent), start, to), start, to];
    }

    function atom() {
      const here = next();
      if (!here) throw wrong("the line ends where something is expected", null);
      if (here.kind === "number") {
        place++;
        return [counted(number(Number(here.text)), here.start, here.end), here.start, here.end];
      }
      if (is("(")) {
        place++;
        const [node] = nested(sum), close = take(")");
        const found = [node, here.start, close.end];
        return found;
      }
      if (here.kind !== "name") throw wrong(`${here.text} has no meaning here`, here);
      place++;
      const open = is("(") || is("[") ? next().text : "";
      if (MEANS.includes(here.text) && open) {
        place++;
        const inner = [nested(sum)[0]];
        while (is(",")) { place++; inner.push(nested(sum)[0]); }
        const close = take(open === "(" ? ")" : "]"), wanted = here.text === "Cov" ? 2 : 1;
        if (inner.length !== wanted) throw wrong(`${here.text} takes ${wanted === 2 ? "two expressions" : "one expression"}`, here);
        const [a, b] = inner;
        const node = here.text === "M" ? mean(a) : here.text === "D" ? minus(mean(power(a, 2)), power(mean(a), 2))
          : minus(mean(product([a, b])), product([mean(a), mean(b)]));
        return [counted(node, here.start, close.end), here.start, close.end];
      }
      if (open === "(" && (FUNCTIONS[here.text] || here.text === "sqrt")) {
        place++;
        const [inner] = nested(sum), close = take(")");
        const node = here.text === "sqrt" ? power(inner, 0.5) : make("call", [inner], here.text);
        return [counted(node, here.start, close.end), here.start, close.end];
      }
      if (open) throw wrong("a function that is not known here, or a product without *", here);
      if (FUNCTIONS[here.text] || here.text === "sqrt") throw wrong(`${here.text} is a function; write ${here.text}(...)`, here);
      const problem = known(here.text);
      if (problem) throw wrong(problem, here);
      return [counted(letter(here.text), here.start, here.end), here.start, here.end];
    }

    const [node, start, end] = sum();
    if (next()) throw wrong(`${next().text} is not expected here; a product needs *, as in 2*x`, next());
    return { ...node, span: [start, end] };
  }

  function constant(node) {
    if (node.kind === "number") return node.data;
    if (node.kind !== "sum" && node.kind !== "product") return null;
    const parts = node.parts.map(constant);
    if (parts.includes(null)) return null;
    if (node.kind === "sum") return parts.reduce((s, one, i) => s + node.data[i] * one, 0);
    const value = parts.reduce((s, one, i) => (node.data[i] > 0 ? s * one : s / one), 1);
    return Number.isFinite(value) ? value : null;
  }

  // ---------------------------------------------------------------- what letters mean

  const pairOf = (i, j) => `${Math.min(i, j) + 1}${Math.max(i, j) + 1}`;

  function lawAt(states, m, d) {
    if (states.length === 1) return { means: [m], cov: [[d]] };
    return { means: states.map((_, i) => `${m}${i + 1}`), cov: states.map((_, i) => states.map((__, j) => `${d}${pairOf(i, j)}`)) };
  }

  function plainSetting() {
    return { states: ["x"], noises: ["v", "w"], ...lawAt(["x"], "m", "d"), meanings: {}, positive: new Set(), known: null, model: null, kind: "gaussian" };
  }

  function modelSetting(model, kind) {
    const { states, v, w, parameters } = model;
    const own = (name) => (parameters.includes(name) ? `${name}_` : name);
    const setting = {
      states, noises: [...v, ...w], ...lawAt(states, own("m"), own("d")), positive: new Set(), model, kind,
      known: new Set([...states, ...v, ...w, ...parameters, ...OF_FILTERS]),
    };
    setting.standard = setting.means[0];
    return withFunctions(setting);
  }

  const lawLetters = (setting) => new Set([...setting.means, ...setting.cov.flat()]);
  const settingAt = (setting, m, d) => withFunctions({ ...setting, ...lawAt(setting.states, m, d) });

  function ofSide(setting, name) {
    const given = !setting.model || setting.means[0] !== setting.standard;
    return given || !/^(tau|Theta)\d*$/.test(name) ? setting : settingAt(setting, "z", "p");
  }

  function withFunctions(setting) {
    const { model, states } = setting;
    if (!model) return setting;
    const own = new Set([...states, ...model.v, ...model.w, ...model.parameters, ...lawLetters(setting)]);
    const found = {};
    const entry = (name, i, j, rows, columns) => (rows === 1 && columns === 1 ? name : `${name}${i + 1}${j + 1}`);
    for (const [first, second, equations, noise] of [["tau", "Theta", model.state, model.v], ["h", "F", model.meter, model.w]]) {
      const trees = equations.map((one) => readLine(one)), size = trees.length;
      const names = trees.map((_, i) => (size === 1 ? first : `${first}${i + 1}`));
      const middle = {};
      states.forEach((x, i) => { middle[x] = letter(setting.means[i]); });
      noise.forEach((one) => { middle[one] = number(0); });
      const atMean = (tree) => replaced(tree, middle);
      trees.forEach((tree, i) => { found[names[i]] = setting.kind === "gaussian" ? mean(tree) : atMean(tree); });
      for (let i = 0; i < size; i++) {
        for (let j = 0; j < size; j++) {
          if (setting.kind === "gaussian") {
            const [a, b] = [i, j].map((k) => minus(trees[k], own.has(names[k]) ? found[names[k]] : letter(names[k])));
            found[entry(second, i, j, size, size)] = mean(i === j ? power(a, 2) : product([a, b]));
          } else {
            const slope = (k, name) => atMean(derivative(trees[k], name));
            const terms = [];
            states.forEach((x, k) => states.forEach((y, l) => terms.push(product([slope(i, x), letter(setting.cov[k][l]), slope(j, y)]))));
            noise.forEach((one) => terms.push(product([slope(i, one), slope(j, one)])));
            found[entry(second, i, j, size, size)] = total(terms);
          }
        }
        if (first === "h") {
          states.forEach((x, j) => {
            const slope = derivative(trees[i], x);
            found[entry("G", i, j, size, states.length)] = setting.kind === "gaussian" ? mean(slope) : atMean(slope);
          });
        }
      }
      if (first === "h") trees.forEach((tree, i) => { found[size === 1 ? "y" : `y${i + 1}`] = tree; });
    }
    const meanings = Object.fromEntries(Object.entries(found).filter(([name]) => !own.has(name)));
    return { ...setting, meanings };
  }

  function problemOf(setting, name) {
    if (!setting.known || setting.known.has(name) || setting.meanings[name] || lawLetters(setting).has(name)) return null;
    const names = [...new Set([...setting.known, ...Object.keys(setting.meanings), ...lawLetters(setting)])].sort().join(", ");
    return `unknown letter '${name}'; known here: ${names}. Declare another one in a line of its own: letters ${name}`;
  }

  // ---------------------------------------------------------------- values

  function randomBy(text) {
    let seed = 2166136261;
    for (const character of text) seed = Math.imul(seed ^ character.codePointAt(0), 16777619);
    return () => {
      seed = (seed + 0x6d2b79f5) | 0;
      let t = Math.imul(seed ^ (seed >>> 15), seed | 1);
      t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
      return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
    };
  }

  const HERMITE = {};
  function hermite(count) {
    if (HERMITE[count]) return HERMITE[count];
    // orthonormal polynomials of the standard normal law; roots between those of the one before, by bisection
    const values = (n, t) => {
      let [before, here] = [0, 1];
      for (let k = 0; k < n; k++) [before, here] = [here, (t * here - Math.sqrt(k) * before) / Math.sqrt(k + 1)];
      return [here, before];
    };
    let roots = [0];
    for (let n = 2; n <= count; n++) {
      const edge = 2 * Math.sqrt(n) + 1, borders = [-edge, ...roots, edge];
      roots = borders.slice(1).map((high, i) => {
        let low = borders[i];
        const sign = Math.sign(values(n, low)[0]);
        for (let k = 0; k < 200; k++) {
          const middle = (low + high) / 2;
          if (middle === low || middle === high) break;
          if (Math.sign(values(n, middle)[0]) === sign) low = middle; else high = middle;
        }
        return (low + high) / 2;
      });
    }
    const weights = roots.map((t) => 1 / (count * values(count, t)[1] ** 2)), sum = weights.reduce((a, b) => a + b);
    return (HERMITE[count] = [roots, weights.map((one) => one / sum)]);
  }

  function degrees(node, setting) {
    if (node.kind === "number") return {};
    if (node.kind === "mean") { degrees(node.parts[0], setting); return {}; }
    if (node.kind === "letter") {
      if (setting.states.includes(node.data) || setting.noises.includes(node.data)) return { [node.data]: 1 };
      return setting.meanings[node.data] ? degrees(setting.meanings[node.data], setting) : {};
    }
    const parts = node.parts.map((part) => degrees(part, setting)), found = {};
    const no = () => new Uncomputed("in a mean only polynomials are computed, and exp, sin, cos, sinh, cosh of linear ones; take the rest out of M[...]");
    parts.forEach((part, i) => {
      for (const name in part) {
        if (node.kind === "product" && node.data[i] < 0) throw no();
        found[name] = node.kind === "sum" ? Math.max(found[name] || 0, part[name]) : (found[name] || 0) + part[name];
      }
    });
    if (node.kind === "sum" || node.kind === "product" || !Object.keys(found).length) return found;
    if (node.kind === "power") {
      if (!Number.isInteger(node.data) || node.data < 0) throw no();
      for (const name in found) found[name] = node.data ? found[name] * node.data : 0;
      return found;
    }
    for (const name in found) {
      if (!ENTIRE.includes(node.data) || found[name] > 1) throw no();
      found[name] = Infinity;
    }
    return found;
  }

  // Values of trees at the same random points: each tree becomes a function of the letters' values.
  class Values {
    constructor(setting, points = TRIED, seed = "") {
      Object.assign(this, { setting, points, seed, slots: {}, kept: new WeakMap() });
      this.env = Array.from({ length: points }, () => []);
      const { states, cov } = setting, n = states.length;
      this.roots = Array.from({ length: points }, (_, p) => {
        if (n === 1) return [[Math.sqrt(this.random(cov[0][0])[p])]];
        return states.map((_, i) => states.map((__, j) => {
          const one = this.random(`root/${i}/${j}`)[p];
          return j > i ? 0 : j === i ? Math.abs(one) : one / 2;
        }));
      });
      if (n > 1) {
        states.forEach((_, i) => states.forEach((__, j) => {
          this.slot(cov[i][j], this.roots.map((root) => root[i].reduce((s, one, k) => s + one * root[j][k], 0)));
        }));
      }
    }

    random(name) {
      const { positive, cov } = this.setting, always = positive.has(name) || cov.some((row, i) => row[i] === name);
      return Array.from({ length: this.points }, (_, p) => {
        const next = randomBy(`${this.seed}${name}/${p}`);
        const sign = always || p < this.points / 3 || next() < 0.5 ? 1 : -1;
        return sign * (0.4 + 1.1 * next());
      });
    }

    slot(name, values) {
      if (!(name in this.slots)) {
        const k = (this.slots[name] = Object.keys(this.slots).length);
        (values || this.random(name)).forEach((value, p) => { this.env[p][k] = value; });
      }
      return this.slots[name];
    }

    letter(name) {
      const k = this.slot(name);
      return this.env.map((env) => env[k]);
    }

    // [value, size of its terms] at one point
    compile(node) {
      if (node.kind === "number") { const one = [node.data, Math.abs(node.data)]; return () => one; }
      if (node.kind === "letter") {
        const meaning = this.setting.meanings[node.data];
        if (meaning) return this.compile(meaning);
        const k = this.slot(node.data);
        return (env) => [env[k], Math.abs(env[k])];
      }
      const parts = node.parts.map((part) => this.compile(part));
      return node.kind === "mean" ? this.averaged(node.parts[0], parts[0]) : this.joined(node, parts);
    }

    joined(node, parts) {
      const { data } = node;
      if (node.kind === "sum") {
        return (env) => {
          let value = 0, size = 0;
          for (let i = 0; i < parts.length; i++) { const [v, s] = parts[i](env); value += data[i] * v; size += s; }
          return [value, size];
        };
      }
      if (node.kind === "product") {
        return (env) => {
          let value = 1, size = 1;
          for (let i = 0; i < parts.length; i++) {
            const [v, s] = parts[i](env);
            if (data[i] > 0) { value *= v; size *= s; } else { value /= v; size *= s / (v * v); }
          }
          return [value, size];
        };
      }
      if (node.kind === "power") {
        return (env) => {
          const [v, s] = parts[0](env), value = v ** data;
          return [value, data > 0 ? s ** data : Math.abs(value) * (s / Math.abs(v)) ** -data];
        };
      }
      const f = FUNCTIONS[data];
      return (env) => {
        const [v, s] = parts[0](env), value = f(v);
        return [value, Math.abs(value) + Math.max(1, Math.abs(value)) * s];
      };
    }

    averaged(node, inner) {
      const { states, noises, means } = this.setting, found = degrees(node, this.setting);
      const axes = [];
      states.forEach((_, i) => { // a component is made of the normal numbers of the axes up to its own
        const degree = states.slice(i).reduce((sum, x) => sum + (found[x] || 0), 0);
        if (degree) axes.push(["state", i, degree]);
      });
      noises.forEach((name) => { if (found[name]) axes.push(["noise", name, found[name]]); });
      const rules = axes.map(([, , degree]) => hermite(degree === Infinity ? 32 : degree + 2));
      const slots = states.map((x) => this.slot(x)), middle = means.map((name) => this.slot(name));
      const noiseSlots = axes.map(([kind, name]) => (kind === "noise" ? this.slot(name) : -1));
      return (env) => {
        const root = this.roots[this.env.indexOf(env)], xi = [], before = env.slice();
        let value = 0, size = 0;
        const along = (k, weight) => {
          if (k === axes.length) {
            states.forEach((_, i) => {
              let x = before[middle[i]];
              for (let j = 0; j <= i; j++) x += root[i][j] * (xi[j] || 0);
              env[slots[i]] = x;
            });
            const [v, s] = inner(env);
            value += weight * v;
            size += weight * s;
            return;
          }
          const [nodes, weights] = rules[k];
          for (let q = 0; q < nodes.length; q++) {
            if (axes[k][0] === "state") xi[axes[k][1]] = nodes[q]; else env[noiseSlots[k]] = nodes[q];
            along(k + 1, weight * weights[q]);
          }
        };
        along(0, 1);
        before.forEach((one, i) => { env[i] = one; });
        return [value, size];
      };
    }

    // values and sizes at all points, or at the first only; parts that were there before a change are not computed again
    pairs(node, count = this.points) {
      let found = this.kept.get(node);
      if (found && found.length >= count) return found;
      const combined = ["sum", "product", "power", "call"].includes(node.kind);
      const parts = combined ? node.parts.map((part) => this.pairs(part, count)) : [];
      const run = combined ? this.joined(node, parts.map((_, i) => (p) => parts[i][p])) : this.compile(node);
      found = this.env.slice(0, count).map((env, p) => run(combined ? p : env));
      this.kept.set(node, found);
      return found;
    }

    of(node) { return this.pairs(node).map(([value]) => value); }
  }

  // ---------------------------------------------------------------- equality

  const EQUAL = "equal", DIFFERENT = "different", IF_POSITIVE = "equal if positive", NO_VALUE = "no value";

  function compare(setting, first, second) {
    const values = new Values(setting), a = values.pairs(first), b = values.pairs(second);
    const same = (i) => Math.abs(a[i][0] - b[i][0]) <= ROUNDING * (a[i][1] + b[i][1]);
    const clear = ([value, size]) => Number.isFinite(value) && ROUNDING * size < CLEAR * (1 + Math.abs(value));
    const defined = (i) => clear(a[i]) && clear(b[i]);
    const either = (i) => clear(a[i]) || clear(b[i]);
    const all = [...a.keys()], positive = all.filter((i) => i < TRIED / 3 && defined(i));
    if (positive.length < FEWEST) return NO_VALUE;
    if (!positive.every(same)) return DIFFERENT;
    if (all.filter(either).every(same)) return EQUAL;
    return IF_POSITIVE;
  }

  // ---------------------------------------------------------------- slips (see exercises/derivations/slips.py)

  const starts = (path, with_) => with_.every((one, i) => path[i] === one);

  function termPath(root, path) {
    for (let length = path.length; length > 0; length--) if (at(root, path.slice(0, length - 1)).kind === "sum") return path.slice(0, length);
    return [];
  }

  function named(root, path) {  // the term, or the function in it whose argument the node is part of
    const functions = path.map((_, i) => path.slice(0, i)).filter((one) => at(root, one).kind === "call");
    return [termPath(root, path), ...functions].reduce((a, b) => (b.length > a.length ? b : a));
  }

  function rational(value) {
    for (let q = 1; q <= 60; q++) {
      const n = Math.round(value * q);
      if (n && Math.abs(n / q - value) <= 1e-8 * Math.abs(value)) return n / q;
    }
    return null;
  }

  const same = (a, b) => a.every((one, i) => Math.abs(one - b[i]) <= CLOSE * (Math.abs(one) + Math.abs(b[i])) + 1e-14);

  // [cost, slip, tree]: the changes of a line, or of the line above, and the tree with each of them
  class Search {
    constructor(setting, line, above) {
      Object.assign(this, { setting, line, above });
      const free = new Set(lawLetters(setting)), waiting = [line, above];
      while (waiting.length) {
        for (const name of letters(waiting.pop())) {
          if (free.has(name)) continue;
          free.add(name);
          if (setting.meanings[name]) waiting.push(setting.meanings[name]);
        }
      }
      this.pool = [...free].sort();
      this.letters = this.pool.filter((name) => !setting.meanings[name]);
      this.values = new Values(setting, free.size + 10, "slip");
      [this.mine, this.theirs] = [line, above].map((one) => this.values.of(one));
      this.inverse = pseudoInverse(this.mine.map((_, p) => [1, ...this.letters.map((name) => Math.log(Math.abs(this.values.letter(name)[p])))]));
      this.terms = walk(above).filter(([, one]) => one.kind === "sum").flatMap(([, one]) => one.parts.map((part, i) => [one.data[i], part]));
    }

    best() {
      const fitting = this.fitting().map(([cost, slip, tree], i) => [cost + this.unlikely(slip), -slip.path.length, i, slip, tree]);
      fitting.sort((a, b) => a[0] - b[0] || a[1] - b[1] || a[2] - b[2]);
      const kept = [], place = (slip) => termPath(slip.above ? this.above : this.line, slip.path);
      for (const [cost, , , slip, tree] of fitting) {
        if (kept.length && cost > kept[0][0] + 1e-9) break;
        const here = place(slip);
        if (kept.some(([, one]) => here.length <= place(one).length && starts(place(one), here))) continue;
        if (this.equal(tree, slip.above || slip.kind === FORGOTTEN ? this.line : this.above)) kept.push([cost, slip]);
      }
      const slips = kept.map(([, slip]) => slip);
      if (slips.length && slips[0].kind === "doubled") return slips.slice(-1);
      return slips.length <= 2 ? slips : [];
    }

    fitting() {
      const found = [], moments = this.moments(), end = Date.now() + 1000 * SECONDS, there = letters(this.above);
      for (const name of this.setting.noises.filter((one) => there.has(one))) {
        const tree = replaced(this.above, { [name]: number(0) });
        if (this.fits(tree, this.mine)) found.push([COSTS[FORGOTTEN], makeSlip(FORGOTTEN, [], name), tree]);
      }
      let count = 0;
      for (const [root, target, ofAbove] of [[this.line, this.theirs, false], [this.above, this.mine, true]]) {
        for (const [path, node] of walk(root)) {
          const around = path.map((_, i) => at(root, path.slice(0, i)));
          const changes = this.ofMoments(path, node, around, moments, ofAbove);
          if (!ofAbove) changes.push(...this.ofNode(path, node, around));
          for (const [cost, slip, other] of changes) {
            if (++count > MOST_TRIED || Date.now() > end) return found;
            const tree = changed(root, path, other);
            if (this.fits(tree, target) && !this.nothing(tree, path, around, slip.kind)) found.push([cost, slip, tree]);
          }
        }
      }
      const lost = this.lost();
      if (lost) found.push(lost);
      return found;
    }

    // whether a tree has these values: most have not at the first point
    fits(tree, values) {
      try { return same([this.values.pairs(tree, 1)[0][0]], [values[0]]) && same(this.values.of(tree), values); } catch (error) {
        if (error instanceof Uncomputed) return false;
        throw error;
      }
    }

    // whether a change leaves nothing of the mean or the power around it
    nothing(tree, path, around, kind) {
      const i = around.findIndex((one) => ["mean", "call", "power"].includes(one.kind));
      if (i < 0) return false;
      const outer = at(tree, path.slice(0, i));
      return this.values.of(kind === "lost-factor" ? outer.parts[0] : outer).every((one) => Math.abs(one) <= 1e-9);
    }

    ofMoments(path, node, around, moments, above) {
      if (around.length && !["sum", "power"].includes(around[around.length - 1].kind)) return [];
      return moments.map(([wrong, right, order]) => [
        COSTS.moment + (above ? OF_THE_LINE_ABOVE : 0), makeSlip("moment", path, "", { order, above }),
        product([node, ...(above ? [wrong, right] : [right, wrong])], [1, 1, -1]),
      ]);
    }

    ofNode(path, node, around) {
      const found = [], { kind, parts, data } = node, outer = around.length ? around[around.length - 1].kind : "";
      const beside = around.length && around[around.length - 1].parts.length > 1;
      const add = (what, other, name = "", below = [], more = 0, lost = null) =>
        found.push([COSTS[what] + more, makeSlip(what, [...path, ...below], name, { lost }), other]);
      const without = (i, value) => make(kind, parts.map((part, j) => (i === j ? number(value) : part)), data);
      if (kind === "sum") {
        parts.forEach((part, i) => {
          add("sign", make("sum", parts, data.map((s, j) => (i === j ? -s : s))), "", [i]);
          if (parts.length < 2) return;
          const signed = (j) => this.values.of(parts[j]).map((v) => data[j] * v);
          add(parts.some((_, j) => j !== i && same(signed(j), signed(i))) ? "doubled" : "extra", without(i, 0), "", [i]);
        });
      }
      if (kind === "letter") for (const name of this.pool) if (name !== data) add("letter", letter(name), data);
      const [base, own] = kind === "power" ? [parts[0], data] : [node, 1], nameOf = (one) => (one.kind === "letter" ? one.data : "");
      if (base.kind !== "number") for (const k of POWERS) if (k !== own) add("power", power(base, k), nameOf(base));
      if (kind === "product") parts.forEach((part, i) => add("extra", without(i, 1), nameOf(part), [i]));
      if (outer !== "product") {
        for (const q of NUMBERS) add(q === -1 ? "sign" : "factor", product([number(q), node]), "", [], kind === "letter" && beside ? 0.35 : 0);
        for (const name of this.pool) for (const k of [1, 2]) add("lost-factor", product([power(letter(name), k), node]), name);
      }
      if (outer !== "sum") {
        for (const [, one] of this.terms) {
          for (const term of [one, mean(one)]) for (const sign of [1, -1]) add("lost", total([node, term], [1, sign]), "", [], 0, one);
        }
      }
      return found;
    }

    // what the line lacks, if that is a number times powers of letters
    lost() {
      const values = this.theirs.map((one, p) => one - this.mine[p]), logs = values.map((one) => Math.log(Math.abs(one)));
      const powers = this.inverse.slice(1).map((row) => Math.round(row.reduce((s, one, p) => s + one * logs[p], 0)));
      if (!powers.every((one) => Math.abs(one) <= 12)) return null;
      const rest = values.map((one, p) => this.letters.reduce((v, name, i) => v / this.values.letter(name)[p] ** powers[i], one));
      const sorted = rest.sort((a, b) => a - b), n = sorted.length;
      const q = rational((sorted[Math.floor((n - 1) / 2)] + sorted[Math.ceil((n - 1) / 2)]) / 2);
      const there = this.letters.map((name, i) => [name, powers[i]]).filter(([, k]) => k);
      const tree = q && total([this.line, product([number(q), ...there.map(([name, k]) => power(letter(name), k))])]);
      if (!tree || !this.fits(tree, this.theirs)) return null;
      return [COSTS.lost, makeSlip("lost", [], there.map(([name]) => name).join(" and ")), tree];
    }

    // wrong and right moments of the normal law, and their order; of functions, too
    moments() {
      const found = [], products = new Map(), { states, means, cov } = this.setting, atMean = Object.fromEntries(states.map((x, i) => [x, letter(means[i])]));
      for (const [, call] of [...walk(this.line), ...walk(this.above)]) {
        if (call.kind === "mean") {
          const [inside] = call.parts;
          for (const term of inside.kind === "sum" ? inside.parts : [inside]) products.set(JSON.stringify(term, (key, value) => (key === "span" ? undefined : value)), this.factors(term));
        }
        if (call.kind !== "call" || !ENTIRE.includes(call.data) || !states.some((x) => letters(call).has(x))) continue;
        const there = replaced(call, atMean);
        found.push([there, mean(call), 0], [power(there, 2), mean(power(call, 2)), 0]);
      }
      for (const factors of products.values()) {
        for (let i = 1; i < factors.length; i++) {
          const apart = [factors.slice(0, i), factors.slice(i)].map((some) => mean(product(some)));
          found.push([product(apart), mean(product(factors)), 0]);
        }
      }
      states.forEach((x, i) => {
        const m = letter(means[i]), d = letter(cov[i][i]), moment = mean(power(letter(x), 2));
        for (let k = 2; k < 9; k++) {
          const [raw, central] = [letter(x), minus(letter(x), m)].map((one) => mean(power(one, k)));
          found.push([power(m, k), raw, k]);
          if (k % 2 === 0) {
            const [square, own] = [moment, d].map((one) => power(one, k / 2)), many = { 2: 1, 4: 3, 6: 15, 8: 105 }[k];
            found.push([central, raw, k], [raw, central, k], [product([number(many), square]), raw, k], [own, central, k], [own, raw, k]);
          }
          if (k === 4) found.push([raw, minus(raw, power(moment, 2)), k]);
        }
      });
      return found;
    }

    factors(node) { // those that depend on the state, x^3 as three of them
      if (node.kind === "product") return node.parts.flatMap((part) => this.factors(part));
      if (node.kind === "power" && [2, 3, 4, 5, 6, 7, 8].includes(node.data)) {
        return Array(node.data).fill(this.factors(node.parts[0])).flat();
      }
      return this.setting.states.some((x) => letters(node).has(x)) ? [node] : [];
    }

    unlikely(slip) { // changing a term that is nothing, or that stands in the line above as it is
      if (slip.above || [FORGOTTEN, "doubled", "extra", "lost"].includes(slip.kind)) return 0;
      const path = termPath(this.line, slip.path), sign = path.length ? at(this.line, path.slice(0, -1)).data[path[path.length - 1]] : 1;
      const value = this.values.of(at(this.line, path)).map((one) => sign * one);
      const stays = path.length && this.terms.some(([own, one]) => same(value, this.values.of(one).map((v) => own * v)));
      return stays || value.every((one) => Math.abs(one) <= 1e-10) ? 0.35 : 0;
    }

    equal(a, b) {
      try { return compare(this.setting, a, b) === EQUAL; } catch (error) {
        if (error instanceof Uncomputed) return false;
        throw error;
      }
    }
  }

  const makeSlip = (kind, path, name = "", more = {}) => ({ kind, path, name, order: 0, lost: null, above: false, ...more });

  function pseudoInverse(rows) { // (A^T A)^-1 A^T by Gauss and Jordan
    const n = rows[0].length;
    const system = [...Array(n).keys()].map((i) => [
      ...[...Array(n).keys()].map((j) => rows.reduce((s, row) => s + row[i] * row[j], 0)), ...rows.map((row) => row[i]),
    ]);
    for (let i = 0; i < n; i++) {
      const best = system.slice(i).reduce((b, row, k) => (Math.abs(row[i]) > Math.abs(system[b][i]) ? i + k : b), i);
      [system[i], system[best]] = [system[best], system[i]];
      system[i] = system[i].map((v) => v / system[i][i]);
      for (let k = 0; k < n; k++) if (k !== i) { const f = system[k][i]; system[k] = system[k].map((v, j) => v - f * system[i][j]); }
    }
    return system.map((row) => row.slice(n));
  }

  const findSlips = (setting, line, above) =>
    new Search(setting, line, above.kind === "letter" && setting.meanings[above.data] ? setting.meanings[above.data] : above).best();

  // ---------------------------------------------------------------- what is said (texts of rules come from the package)

  function told(setting, slip, text, line, textAbove, above) {
    const shown = (from, node) => (node.span ? from.slice(...node.span) : "");
    const moment = slip.kind === "moment" && !slip.order ? ": the mean of a function, a square or a product is not that of means"
      : slip.order ? `: it takes a moment of order ${slip.order} for another one` : "";
    if (slip.above) {
      const term = textAbove ? shown(textAbove, at(above, named(above, slip.path))) : "";
      return `what has been made of ${term ? `\`${term}\` of the line above` : "a term of the definition"} is not right${moment}`;
    }
    const place = named(line, slip.path), term = shown(text, at(line, place)), { name } = slip;
    const role = setting.means.includes(name) ? "a mean" : setting.cov.some((row, i) => row[i] === name) ? "a variance"
      : lawLetters(setting).has(name) ? "a covariance" : setting.states.includes(name) ? "the state"
      : setting.noises.includes(name) ? "a noise" : "a parameter";
    const lost = slip.lost && slip.lost.span && textAbove ? ` of the line above, \`${shown(textAbove, slip.lost)}\`` : name ? `, one with ${name}` : "";
    const says = {
      sign: `${place.length > termPath(line, slip.path).length ? "a sign in" : "the sign of"} \`${term}\` is not right`,
      doubled: `\`${term}\` stands there twice`,
      letter: `in \`${term}\` the letter ${name}, ${role}, stands in another one's place`,
      moment: `\`${term}\` is not right${moment}`,
      power: `${name || "something"} has the wrong power in \`${term}\``,
      factor: `a number in \`${term}\` is not right`,
      "noise-forgotten": `the mean square of the noise ${name} is forgotten: its part is missing`,
      "lost-factor": `a factor is lost from \`${term}\`: ${name}`,
      extra: name ? `something in \`${term}\` does not belong there` : `\`${term}\` does not belong there`,
      lost: `a term is lost${lost}, in \`${term}\``,
    };
    return says[slip.kind];
  }

  function ruleOf(texts, setting, slip, line, above, name) {
    const bare = name.replace(/\d+$/, "");
    if (name && texts.definitions[setting.kind][bare]) return texts.definitions[setting.kind][bare];
    const kind = slip ? slip.kind : "", here = letters(line), rules = texts.rules;
    const noises = [...letters(above)].some((one) => setting.noises.includes(one) && !here.has(one));
    const means = (node) => walk(node).map(([, one]) => one).filter((one) => one.kind === "mean" && [...letters(one)].some((s) => setting.states.includes(s)));
    const squares = (node) => walk(node).filter(([, one]) => one.kind === "power" && one.parts[0].kind === "sum").length;
    if (kind === FORGOTTEN || (noises && ["extra", "lost", "doubled", ""].includes(kind))) return rules.noise;
    if (kind === "moment" || means(above).length > means(line).length) {
      return rules[means(above).some((one) => walk(one).some(([, inner]) => inner.kind === "call")) ? "functions" : "moments"];
    }
    if (["lost", "factor", "extra"].includes(kind) && squares(above) > squares(line)) return rules.square;
    if (["power", "lost-factor"].includes(kind) && ![...setting.states, ...setting.noises].includes(slip.name)) return rules.constant;
    return rules[kind === "sign" ? "sign" : noises ? "noise" : "terms"];
  }

  // ---------------------------------------------------------------- a whole text

  function* readChains(text, models, setting) {
    const lines = text.split(/\r?\n/);
    if (lines.length > MOST_LINES) throw new DerivationError(`the derivation has ${lines.length} lines; at most ${MOST_LINES} are checked: split it up`);
    let chain = null;
    for (const [i, whole] of lines.entries()) {
      const line = whole.split("#")[0].trimEnd(), n = i + 1;
      if (!line.trim()) continue;
      if (!line.includes("=")) {
        if (chain) yield chain;
        chain = null;
        setting = heading(line.trim(), n, setting, models);
        continue;
      }
      let column = 0;
      let pieces = line.split("=").map((piece) => {
        const one = { line: n, column: column + piece.length - piece.trimStart().length, text: piece.trim() };
        column += piece.length + 1;
        return one;
      });
      if (pieces[0].text) {
        if (chain) yield chain;
        chain = { setting, links: [] };
      } else if (!chain) {
        throw new DerivationError(`line ${n}: '${line.trim().slice(0, 60)}' goes on, but nothing stands above it; begin with a name, as in F = ...`);
      } else pieces = pieces.slice(1);
      chain.links.push(...pieces);
    }
    if (chain) yield chain;
  }

  function heading(line, n, setting, models) {
    const [word, ...more] = line.split(" "), rest = more.join(" ").trim();
    if (word === "variant" && rest) {
      if (!models[rest]) throw new DerivationError(`line ${n}: there is no variant ${rest} on this page`);
      return modelSetting(models[rest], setting.kind);
    }
    if (line === "gaussian" || line === "linearised") return setting.model ? modelSetting(setting.model, line) : { ...setting, kind: line };
    const law = /^x\s*~\s*N\s*\(\s*(\w+)\s*,\s*(\w+)\s*\)$/.exec(line);
    if (law) return settingAt(setting, law[1], law[2]);
    if ((word === "positive" || word === "letters") && rest) {
      const names = rest.split(/[\s,]+/);
      const bad = names.find((name) => !/^[A-Za-z][A-Za-z0-9_]{0,30}$/.test(name));
      if (bad !== undefined) throw new DerivationError(`line ${n}: '${bad}' cannot name a symbol: use letters, digits and _, a letter first`);
      if (word === "positive") return { ...setting, positive: new Set([...setting.positive, ...names]) };
      return setting.known ? { ...setting, known: new Set([...setting.known, ...names]) } : setting;
    }
    throw new DerivationError(`line ${n}: '${line.slice(0, 60)}' has no =, and is no heading; headings are: variant 53, linearised, gaussian, ` +
      "x ~ N(m, d), positive c, g, letters S, q");
  }

  function checkText(text, models = {}, texts = { rules: {}, definitions: { gaussian: {}, linearised: {} } }, base = null) {
    const derived = {}, verdicts = [];
    for (const chain of readChains(text, models, base || plainSetting())) checkChain(chain, derived, texts, verdicts);
    return verdicts;
  }

  // Whether what stands for a name has the name in it again, as the letters mean here.
  function comesBack(setting, name, tree) {
    const seen = new Set(), waiting = [tree];
    while (waiting.length) {
      const node = waiting.pop();
      if (node.kind !== "letter") waiting.push(...node.parts);
      else if (!seen.has(node.data)) {
        seen.add(node.data);
        if (node.data !== name && setting.meanings[node.data]) waiting.push(setting.meanings[node.data]);
      }
    }
    return seen.has(name);
  }

  function checkChain(chain, derived, texts, verdicts) {
    const [first, ...rest] = chain.links, name = /^[A-Za-z_]\w*$/.test(first.text) ? first.text : "";
    let setting = ofSide(chain.setting, name);
    const law = [...lawLetters(setting)].join();
    for (const one in derived) {
      if (derived[one].law === law && one !== name) setting = { ...setting, meanings: { ...setting.meanings, [one]: derived[one].tree } };
    }
    const meant = Boolean(setting.meanings[name]);
    let previous = meant ? letter(name) : null, above = meant || name ? "" : first.text, right = previous, broken = 0;
    const say = (link, status, says = "", more = {}) => verdicts.push({ ...link, status, says, kinds: [], spans: [], rule: "", ...more });
    for (const link of name ? rest : chain.links) {
      let node;
      try {
        node = readLine(link.text, (one) => problemOf(setting, one));
        if (previous === null) {
          compare(setting, node, node);
          say(link, "begins", "nothing to compare it with: the chain is checked from here");
          right = node;
        } else judge(link, node);
      } catch (error) {
        if (error instanceof Unreadable) {
          say(link, "unreadable", `cannot be read at column ${link.column + error.column + 1}: ${error.message}`, { spans: [[error.column, error.column + 1]] });
        } else if (error instanceof Uncomputed) say(link, "undecided", error.message);
        else throw error;
        continue;
      }
      previous = node;
      above = link.text;
    }
    if (name && previous && !lawLetters(setting).has(name) && !comesBack(setting, name, previous)) derived[name] = { law, tree: previous };

    function judge(link, node) {
      const key = above ? "" : name, result = compare(setting, node, previous);
      if (result === EQUAL) {
        if (broken) say(link, "follows", `right on top of line ${broken}`);
        else { say(link, "right"); right = node; }
        return;
      }
      if (broken && right && compare(setting, node, right) === EQUAL) {
        say(link, "right in itself", `right in itself: equal to what stood before the slip of line ${broken}`);
        broken = 0;
        return;
      }
      const where = key ? `what ${key} means` : "the one above";
      if (result === NO_VALUE) throw new Uncomputed(`no value to compare with ${where}: a division by zero, a root of something negative, or numbers too large`);
      if (result === IF_POSITIVE) {
        say(link, "differs", `equal to ${where} only for positive letters: declare them in a line of its own before the chain, positive ...`, { kinds: ["positive"] });
      } else {
        const slips = findSlips(setting, node, previous);
        const said = slips.map((slip) => told(setting, slip, link.text, node, above, previous));
        const says = said.length ? `the line differs from ${where}: ${said.join(" or ")}`
          : `It is not equal to ${where}, and no single change explains it: was more than one step taken at once?`;
        say(link, "differs", says, {
          kinds: slips.map((slip) => slip.kind),
          spans: slips.filter((slip) => !slip.above).map((slip) => at(node, named(node, slip.path)).span).filter(Boolean),
          rule: ruleOf(texts, setting, slips[0], node, previous, key),
        });
      }
      broken = broken || link.line;
    }
  }

  window.kfcourseDerive = { checkText, modelSetting, plainSetting, readLine, hermite, compare, DerivationError, Unreadable, Uncomputed };
})();

// The field of the page: nothing leaves the browser, which keeps what was typed.
(function () {
  "use strict";
  const MARKS = { begins: "·", right: "✓", follows: "✓", "right in itself": "✓", differs: "✗", unreadable: "?", undecided: "?" };

  function element(name, content, attributes = {}) {
    const made = document.createElement(name);
    Object.entries(attributes).forEach(([key, value]) => made.setAttribute(key, value));
    made.append(...[].concat(content));
    return made;
  }

  const coded = (text) => text.split("`").map((part, i) => (i % 2 ? element("code", part) : part));

  function marked(verdict) {
    const pieces = [];
    let end = 0;
    for (const [start, stop] of [...verdict.spans].sort((a, b) => a[0] - b[0])) {
      if (start < end) continue;
      pieces.push(verdict.text.slice(end, start), element("mark", verdict.text.slice(start, stop)));
      end = stop;
    }
    return element("code", [...pieces, verdict.text.slice(end)]);
  }

  function show(field) {
    const derive = window.kfcourseDerive, { models, texts } = JSON.parse(field.querySelector("script").textContent);
    const value = (name) => field.querySelector(`[data-set=${name}]`).value;
    const result = field.querySelector("[data-show]"), status = field.querySelector("[role=status]");
    result.replaceChildren();
    try {
      const model = value("variant") ? models[value("variant")] : ownModel(derive, value("state"), value("meter"));
      const verdicts = derive.checkText(value("text"), models, texts, derive.modelSetting(model, value("kind")));
      const list = element("ol", verdicts.map((one) => element("li", [
        marked(one), ` `, element("span", `${MARKS[one.status]} ${one.status}`),
        ...[one.says, one.rule].filter(Boolean).map((part) => element("p", coded(part))),
      ], { class: `kf-${one.status.replaceAll(" ", "-")}` })), { class: "kf-derived" });
      result.append(list);
      const bad = verdicts.filter((one) => MARKS[one.status] !== "✓" && one.status !== "begins").length;
      const lines = `${verdicts.length} line${verdicts.length === 1 ? "" : "s"}, `;
      status.textContent = verdicts.length ? lines + (bad ? `${bad} to look at` : "each equal to the one above") : "type a line such as h = M[g*x]";
    } catch (error) {
      if (![derive.DerivationError, derive.Unreadable, derive.Uncomputed].some((kind) => error instanceof kind)) throw error;
      status.textContent = error.message;
    }
  }

  // the letters of one's own equations: x the state, v... and w... the noises, all others parameters
  function ownModel(derive, state, meter) {
    const names = new Set(), note = (name) => { names.add(name); return null; };
    for (const [text, which] of [[state, "next x"], [meter, "y"]]) {
      try { derive.readLine(text, note); } catch (error) { throw new derive.DerivationError(`${which} = ${text}: ${error.message}`); }
    }
    const noises = (letter) => [...names].filter((name) => new RegExp(`^${letter}\\d*$`).test(name)).sort();
    const v = noises("v"), w = noises("w");
    const parameters = [...names].filter((name) => name !== "x" && !v.includes(name) && !w.includes(name));
    return { states: ["x"], v, w, parameters, state: [state], meter: [meter] };
  }

  // Where a browser keeps nothing, the field begins anew each time.
  const KEPT = "kf-derive";
  function keep(controls) {
    try { localStorage.setItem(KEPT, JSON.stringify(Object.fromEntries(controls.map((one) => [one.dataset.set, one.value])))); } catch { /* it is full, or closed */ }
  }
  function kept() {
    try { return JSON.parse(localStorage.getItem(KEPT)) ?? {}; } catch { return {}; }
  }

  function start() {
    document.querySelectorAll(".kf-derive").forEach((field) => {
      field.hidden = false;
      const controls = [...field.querySelectorAll("[data-set]")], [variant, text] = ["variant", "text"].map((name) => field.querySelector(`[data-set=${name}]`));
      const { models } = JSON.parse(field.querySelector("script").textContent), first = variant.value;
      // what a derivation begins with; the variant shown first has a whole example
      const example = () => {
        const model = models[variant.value], several = model?.meter.length > 1 ? "1" : "";
        return variant.value === first ? text.defaultValue : model ? `h${several} = M[${model.meter[0]}]` : "";
      };
      let given = example();
      const own = () => { field.querySelector("[data-own]").hidden = variant.value !== ""; };
      const before = kept();
      for (const one of controls) {
        if (before[one.dataset.set] === undefined) continue;
        const old = one.value;
        one.value = before[one.dataset.set];
        if (one.matches("select") && one.selectedIndex < 0) one.value = old;  // a variant that is no more
      }
      if (text.value !== given) given = example();
      field.addEventListener("input", () => keep(controls));
      variant.addEventListener("change", () => {
        if ([given, ""].includes(text.value.trim())) text.value = given = example();  // not what the reader typed
        keep(controls);
        own();
        show(field);
      });
      field.querySelector("[data-set=kind]").addEventListener("change", () => show(field));
      field.querySelector("[data-do=check]").addEventListener("click", () => show(field));
      field.addEventListener("keydown", (event) => { if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) show(field); });
      own();
      show(field);
    });
  }

  if (typeof document !== "undefined") start();  // at once: what stands below has its place when it is first seen
})();
