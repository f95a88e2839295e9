// The lab in the browser: trajectories, designed filters, the exact filter on nodes of its own, and what a comparison says.
// A model is the object that kfcourse/pages/browser.py prints: its formulas are SymPy's, none is written here.
// Arrays run over the ensemble; an array of such arrays runs over the steps.

const kfMean = (n, a) => {
  let sum = 0;
  for (let i = 0; i < n; i++) sum += a[i];
  return sum / n;
};
const kfCov = (n, a, b) => {  // deviations from the means: large means do not cancel
  const ma = kfMean(n, a), mb = a === b ? ma : kfMean(n, b);
  let sum = 0;
  for (let i = 0; i < n; i++) sum += (a[i] - ma) * (b[i] - mb);
  return sum / n;
};

const kfLab = (() => {
  const CARRIER = "aof-gaussian";
  const numbers = (n) => new Float64Array(n);
  const filled = (n, value) => numbers(n).fill(value);

  // Standard normal numbers: Box and Muller's, of T. Ettinger's mulberry32.
  const normals = (seed, count) => {
    const uniform = () => {
      seed = (seed + 0x6d2b79f5) | 0;
      let t = Math.imul(seed ^ (seed >>> 15), seed | 1);
      t = (t + Math.imul(t ^ (t >>> 7), t | 61)) ^ t;
      return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
    };
    const found = numbers(count + 1);
    for (let i = 0; i < count; i += 2) {
      const radius = Math.sqrt(-2 * Math.log(1 - uniform())), angle = 2 * Math.PI * uniform();
      found[i] = radius * Math.cos(angle);
      found[i + 1] = radius * Math.sin(angle);
    }
    return found.subarray(0, count);
  };
  const draws = (seed, n, steps, [ofState, ofMeter]) => {
    const each = (k, size) => normals(seed + 7919 * k, size);
    const over = (from, size) => Array.from({ length: steps }, (_, k) => each(from + 2 * k, size));
    return { n, steps, start: each(0, n), v: over(1, n * ofState), w: over(2, n * ofMeter) };
  };

  // Initial states for small standard errors: half from the prior, half from a law so many times as wide, for what makes filters
  // differ is often what happens far out.  The weight, prior over the law drawn from, is between 0 and 2.
  const widened = (drawn, wide) => {
    const start = drawn.start.map((one, i) => (i % 2 ? wide : 1) * one);
    return { ...drawn, start, weight: start.map((t) => 2 / (1 + Math.exp(0.5 * (1 - wide ** -2) * t * t) / wide)) };
  };

  const simulate = (model, { values, prior }, { n, steps, start, v, w }) => {
    const x = [numbers(n).map((_, i) => prior.mean + Math.sqrt(prior.variance) * start[i])], y = [];
    for (let k = 0; k < steps; k++) {
      const a = { x: x[k], v: v[k], w: w[k], y: numbers(n), next: numbers(n) };
      model.simulate(n, values, {}, a);
      y.push(a.y);
      x.push(a.next);
    }
    return { n, steps, x, y };
  };

  // A filter over stored trajectories.  Without coefficients it is designed on them, and they are returned, step by step.
  const run = (model, { values, prior }, name, tracks, coefficients = null) => {
    const { n, steps, x, y } = tracks, filter = model.filters[name];
    const a = new Proxy({ lambda: filled(n, prior.mean), Psi: filled(n, prior.variance) }, {
      get: (arrays, key) => (arrays[key] ??= numbers(n)),
    });
    const designing = filter.design && !coefficients, found = [], z = [], p = [], spread = [];
    for (let k = 0; k < steps; k++) {
      spread.push(kfMean(n, a.Psi));
      a.z = numbers(n);
      if (name === CARRIER) a.p = numbers(n);
      a.y = y[k];
      const c = designing ? {} : (coefficients?.[k] ?? {});
      if (designing) [a.x, a.next] = [x[k], x[k + 1]];
      filter[designing ? "design" : "step"](n, values, c, a);
      found.push(c);
      z.push(a.z);
      if (name === CARRIER) p.push(a.p);
    }
    return { z, p, spread, coefficients: found };
  };

  // ------------------------------------------------------------------ the exact filter, one trajectory at a time

  // The densities are those of the linearised structure at variance 0: for noises that enter linearly the next state is
  // N(tau(x, 0), Theta(x, 0)) and a measurement is N(h(x, 0), F(x, 0)).
  const LEAST = 1e-300;
  const REACH = 6.5;  // standard deviations of the kernel around the nodes: 1e-10 of the mass is beyond
  const conditional = (model, values, nodes) => {
    const n = nodes.length, no = numbers(n);
    const a = { z: nodes, p: no, m: nodes, d: no, tau: numbers(n), Theta: numbers(n), h: numbers(n), G: no.slice(), F: numbers(n) };
    model.linearised.predict(n, values, {}, a);
    model.linearised.measure(n, values, {}, a);
    return a;
  };

  // Panels where the density has its mass, [from, to].  An interval is halved where most may be hidden: a log-concave density lies below the
  // chords of the neighbouring intervals, drawn on, so a peak narrower than the first nodes' distance is found from its slopes.
  const place = (logDensity, first, most) => {
    const x = first.sort((a, b) => a - b).filter((one, i) => i === 0 || one > first[i - 1]);
    const l = x.map(logDensity);
    const hidden = (i) => {
      const [a, b, la, lb] = [x[i], x[i + 1], l[i], l[i + 1]];
      let top = Math.max(la, lb);
      if (i > 0 && i + 2 < x.length) {
        const left = (la - l[i - 1]) / (a - x[i - 1]), right = (l[i + 2] - lb) / (x[i + 2] - b);
        const t = left === right ? a : (lb - la + left * a - right * b) / (left - right);
        if (t > a && t < b) top = Math.max(top, la + left * (t - a));
      }
      return Math.log(b - a) + top + Math.log(1 - 0.7 * Math.exp(Math.min(la, lb) - top));
    };
    const worth = x.slice(1).map((_, i) => hidden(i));
    while (x.length < most) {
      let i = 0;
      for (let j = 1; j < worth.length; j++) if (worth[j] > worth[i]) i = j;
      const middle = 0.5 * (x[i] + x[i + 1]);
      if (!(middle > x[i] && middle < x[i + 1])) break;  // no number lies between
      x.splice(i + 1, 0, middle);
      l.splice(i + 1, 0, logDensity(middle));
      worth.splice(i + 1, 0, 0);
      for (let j = Math.max(0, i - 1); j <= Math.min(worth.length - 1, i + 2); j++) worth[j] = hidden(j);
    }
    const top = worth.reduce((a, b) => Math.max(a, b));
    return worth.flatMap((one, i) => (one > top + Math.log(1e-7) ? [[x[i], x[i + 1]]] : []));
  };
  const GAUSS = [[-Math.sqrt(0.6), 5 / 18], [0, 4 / 9], [Math.sqrt(0.6), 5 / 18]];  // exact for polynomials of degree 5

  // Where a measurement is explained without noise, in [low, high], and how well it tells the state there: nodes around each such
  // place, for a sharp meter's peak may be a millionth of the range wide.
  const WIDTHS = [-8, -4, -2, -1, 0, 1, 2, 4, 8];
  const around = (meter, measured, nodes) => {
    const residual = (x) => meter(x).h[0] - measured, found = [];
    for (let i = 1; i < nodes.length; i++) {
      let [a, b] = [nodes[i - 1], nodes[i]];
      const below = residual(a) < 0;
      if (below === residual(b) < 0) continue;
      for (let step = 0; step < 60; step++) {
        const middle = 0.5 * (a + b);
        if (residual(middle) < 0 === below) a = middle;
        else b = middle;
      }
      const { F, G } = meter(b), width = Math.sqrt(F[0]) / Math.abs(G[0]);
      if (width > 0 && isFinite(width)) found.push(...WIDTHS.map((t) => b + t * width));
    }
    return found;
  };

  // y: the measurements of one trajectory.  Means, variances, and the density's nodes after each.
  const exact = (model, { values, prior }, y, { first = 20, most = 44 } = {}) => {
    const one = { z: numbers(1), p: numbers(1), m: numbers(1), d: numbers(1), tau: numbers(1), Theta: numbers(1), h: numbers(1), G: numbers(1), F: numbers(1) };
    const sd = Math.sqrt(prior.variance);
    let low = prior.mean - REACH * sd, high = prior.mean + REACH * sd, before = null;
    const predicted = (x) => {
      if (!before) return -0.5 * ((x - prior.mean) / sd) ** 2;
      const { mass, mean, width, count } = before;
      let sum = 0;
      for (let j = 0; j < count; j++) {
        const t = (x - mean[j]) / width[j];
        if (t * t < 80) sum += mass[j] * Math.exp(-0.5 * t * t);
      }
      return sum > 0 ? Math.log(sum) : -800;
    };
    const meter = (x) => {
      one.m[0] = x;
      model.linearised.measure(1, values, {}, one);
      return one;
    };
    const densities = [], z = [], p = [];
    for (const measured of y) {
      const nodes = Array.from({ length: first }, (_, i) => low + ((high - low) * i) / (first - 1));
      nodes.push(...around(meter, measured, nodes));
      const logDensity = (at) => {
        const { h, F } = meter(at), variance = Math.max(F[0], LEAST);
        return Math.max(predicted(at) - 0.5 * ((measured - h[0]) ** 2 / variance + Math.log(variance)), -1e30);
      };
      const panels = place(logDensity, nodes, most), size = GAUSS.length * panels.length;
      const x = numbers(size), weight = numbers(size);
      panels.forEach(([from, to], i) => GAUSS.forEach(([t, part], j) => {
        x[GAUSS.length * i + j] = 0.5 * (from + to + t * (to - from));
        weight[GAUSS.length * i + j] = part * (to - from);
      }));
      const l = Array.from(x, logDensity), top = l.reduce((a, b) => Math.max(a, b)), density = l.map((one) => Math.exp(one - top));
      const mass = weight.map((one, i) => one * density[i]), total = mass.reduce((a, b) => a + b);
      let mean = 0, variance = 0;
      for (let i = 0; i < size; i++) mean += (mass[i] / total) * x[i];
      for (let i = 0; i < size; i++) variance += (mass[i] / total) * (x[i] - mean) ** 2;
      z.push(mean);
      p.push(variance);
      densities.push({ x, density: density.map((one) => one / total) });
      // What the next step is predicted from: the nodes that have mass, each kernel as wide as the nodes are apart at least.
      const law = conditional(model, values, x);
      before = { mass: numbers(size), mean: numbers(size), width: numbers(size), count: 0 };
      low = Infinity;
      high = -Infinity;
      for (let i = 0; i < size; i++) {
        if (mass[i] < 1e-9 * total) continue;
        const gap = 0.5 * Math.abs(law.tau[Math.min(i + 1, size - 1)] - law.tau[Math.max(i - 1, 0)]), j = before.count++;
        const width = Math.max(Math.sqrt(Math.max(law.Theta[i], 0)), 0.6 * gap, 1e-150);
        [before.mean[j], before.width[j], before.mass[j]] = [law.tau[i], width, mass[i] / total / width];
        low = Math.min(low, law.tau[i] - REACH * width);
        high = Math.max(high, law.tau[i] + REACH * width);
      }
      if (!(high > low && isFinite(high - low))) break;
    }
    while (z.length < y.length) {
      z.push(NaN);
      p.push(NaN);
    }
    return { z, p, densities };
  };

  // ------------------------------------------------------------------ what a comparison says

  const squares = (n, x, z) => numbers(n).map((_, i) => (x[i] - z[i]) ** 2);

  // D_k of a filter: M(x_k - z_k)^2 with its standard error.
  const errorVariance = (n, x, z) => {
    const e = squares(n, x, z);
    return [kfMean(n, e), Math.sqrt(kfCov(n, e, e) / n)];
  };

  // How far above the bound, D_k / D_k(exact) - 1, with its standard error.  `all` are many trajectories without the exact filter,
  // `few` others with it, which count by their weights.  The bound is the mean of the exact filter's own variance: over all, that of
  // the Gaussian filter, and over the few what the exact one has more.  What a filter is above it is estimated twice, from its
  // errors e^2 and, as the exact error is uncorrelated with all measurements, from its distance (z - z_exact)^2; each counts by its
  // variance.
  const aboveBound = (all, few) => {
    const { n } = all, m = few.n, finite = isFinite(kfMean(n, all.carrier)) && isFinite(kfMean(m, few.carrier));
    const carried = finite ? all.carrier : numbers(n), of = finite ? few.carrier : numbers(m);
    const e = squares(n, all.x, all.z), distance = squares(m, few.z, few.exact).map((d, i) => d * few.weight[i]);
    const over = e.map((one, i) => one - carried[i]), rest = few.variance.map((p, i) => few.weight[i] * (p - of[i]));
    const more = kfMean(m, rest), bound = kfMean(n, carried) + more;
    const square = (size, values) => kfCov(size, values, values) / size;
    const ofErrors = square(n, over) + square(m, rest), ofDistance = square(m, distance);
    const share = ofErrors + ofDistance > 0 ? ofErrors / (ofErrors + ofDistance) : 1;
    const ratio = (share * kfMean(m, distance) + (1 - share) * (kfMean(n, over) - more)) / bound;
    const variance = square(n, over.map((one, i) => (1 - share) * one - ratio * carried[i]))
      + square(m, distance.map((one, i) => share * one - (1 - share + ratio) * rest[i]));
    return [ratio, Math.sqrt(variance) / bound, bound];
  };

  // All filters of a model: their coefficients, from trajectories of their own; and what they make of others.
  const design = (model, settings, tracks) =>
    Object.fromEntries(Object.keys(model.filters).map((name) =>
      [name, model.filters[name].design ? run(model, settings, name, tracks).coefficients : null]));
  const runAll = (model, settings, coefficients, tracks) =>
    Object.fromEntries(Object.keys(model.filters).map((name) => [name, run(model, settings, name, tracks, coefficients[name])]));

  return { CARRIER, normals, draws, widened, simulate, run, exact, errorVariance, aboveBound, design, runAll };
})();
