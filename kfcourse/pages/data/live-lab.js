// "The lab, live": all filters of a scalar model on common trajectories, as its parameters move.  The worker's part, then the page's.

const kfServe = () => {
  const WIDE = 2.5;
  const GROWING = [200, 400];  // trajectories with the exact filter; of fewer the bands would cover too seldom
  const kept = new Map();
  const once = (key, make) => {
    if (!kept.has(key)) kept.set(key, make());
    return kept.get(key);
  };
  let latest = 0;
  onmessage = async ({ data: question }) => {
    const { number, variant, settings, n, steps, seed, shown } = question, model = kfModels[variant];
    latest = number;
    const draws = (which, size) =>
      once([model.noises, which, size, steps, seed].join(), () => kfLab.draws(1e6 * seed + 3e5 * which, size, steps, model.noises));
    const many = [0, 1].map((which) => draws(which, n));
    const begun = performance.now();
    const coefficients = kfLab.design(model, settings, kfLab.simulate(model, settings, many[0]));
    const tracks = kfLab.simulate(model, settings, many[1]), found = kfLab.runAll(model, settings, coefficients, tracks);
    const over = (of) => Object.fromEntries(Object.keys(found).map((name) => [name, tracks.y.map((_, k) => of(name, k))]));
    const errors = over((name, k) => kfLab.errorVariance(n, tracks.x[k], found[name].z[k]));
    const milliseconds = performance.now() - begun;

    const plain = draws(2, GROWING.at(-1)), finite = (one) => one.x.every((x) => x.every(isFinite));
    const [few, start] = [WIDE, 1].map((wide) => {
      const start = kfLab.widened(plain, wide);
      return [kfLab.simulate(model, settings, start), start];
    }).find(([one], i) => i === 1 || finite(one));
    const ofFew = kfLab.runAll(model, settings, coefficients, few), exactly = (i) => kfLab.exact(model, settings, few.y.map((y) => y[i]));
    const one = exactly(shown), at = (arrays) => Array.from({ length: steps }, (_, k) => arrays[k][shown]);
    const carrier = ofFew[kfLab.CARRIER];
    postMessage({
      kind: "errors", number, errors, milliseconds, finite: finite(tracks), coefficients, spread: found[kfLab.CARRIER].spread,
      state: tracks.y.map((_, k) => [kfMean(n, tracks.x[k]), Math.sqrt(kfCov(n, tracks.x[k], tracks.x[k]))]),
      track: { x: at(few.x), exact: one, p: at(carrier.p), z: Object.fromEntries(Object.keys(ofFew).map((name) => [name, at(ofFew[name].z)])) },
    });

    const exact = [];
    for (const m of GROWING) {
      while (exact.length < m) {
        exact.push(exactly(exact.length));
        if (exact.length % 10 === 0) await new Promise((resume) => setTimeout(resume));
        if (latest !== number) return;  // the reader has gone on
      }
      const column = (key, k) => Float64Array.from(exact, (of) => of[key][k]);
      const above = over((name, k) => kfLab.aboveBound(
        { n, x: tracks.x[k], z: found[name].z[k], carrier: found[kfLab.CARRIER].p[k] },
        { n: m, weight: start.weight.subarray(0, m), z: ofFew[name].z[k], exact: column("z", k), variance: column("p", k), carrier: carrier.p[k] },
      ));
      postMessage({ kind: "bound", number, above, m });
    }
  };
};

if (typeof document === "undefined") kfServe();

const kfLiveLab = (root, name, given) => {
  const { looks, runs, steps, reach } = given, names = Object.keys(looks);
  const MINUS = "\u2212", SPACE = "\u00a0";
  const thousands = (number) => (number < 10000 ? `${number}` : number.toLocaleString("en"));
  const key = (variant, parameter) => `${variant}.${parameter}`;
  const defaults = { variant: given.first, step: given.step, seed: 1, shown: 2, function: "F" };
  for (const [variant, model] of Object.entries(kfModels)) {
    for (const [parameter, value] of Object.entries(model.parameters)) defaults[key(variant, parameter)] = value;
    defaults[key(variant, "prior-mean")] = model.prior.mean;
    defaults[key(variant, "prior-variance")] = model.prior.variance;
  }
  const percent = (value, error) => (isFinite(value) ? `${(100 * value).toFixed(2)} ± ${(100 * reach * error).toFixed(2)}`.replace("-", MINUS) : "diverges");

  kfFigure(root, name, defaults, (ui) => {
    const chosen = ui.row(), sliders = ui.row(), keys = ui.row("kf-lines"), main = ui.row("kf-charts"), status = ui.says(), table = ui.row("kf-numbers");
    const looking = ui.row(), charts = ui.row("kf-charts");
    ui.legend([...Object.values(looks), { label: "exact filter; truth", colour: "#1f2328" }], keys);
    ui.choice(chosen, "variant", { label: "Variant", options: Object.keys(kfModels).sort((a, b) => a - b).map((one) => [one, given.variants[one]]) });
    ui.slider(chosen, "seed", { label: "Random numbers", low: 1, high: 50, step: 1, say: String });
    ui.slider(looking, "step", { label: "Step k", low: 0, high: steps - 1, step: 1, say: String });
    ui.slider(looking, "shown", { label: "Trajectory", low: 0, high: 98, step: 2, say: (value) => String(value / 2 + 1) });
    ui.choice(looking, "function", { label: "Structural function", options: [["tau", "τ"], ["Theta", "Θ"], ["h", "h"], ["G", "G"], ["F", "F"]] });
    const controls = (variant) => {
      ui.clear(sliders);
      const model = kfModels[variant];
      for (const [parameter, value] of Object.entries(model.parameters)) {
        const size = Math.abs(value), step = 10 ** Math.floor(Math.log10(size / 30)), end = Math.round((1.5 * value) / step) * step;
        const range = model.levels.includes(parameter) ? { low: value / 10, high: value * 10, log: true } : { low: Math.min(0, end), high: Math.max(0, end), step };
        ui.slider(sliders, key(variant, parameter), { label: parameter, ...range });
      }
      const { mean, variance } = model.prior, sd = Math.sqrt(variance);
      ui.slider(sliders, key(variant, "prior-mean"), { label: "mean of the prior", low: mean - 3 * sd, high: mean + 3 * sd, step: sd / 10 });
      ui.slider(sliders, key(variant, "prior-variance"), { label: "variance of the prior", low: variance / 100, high: variance * 10, log: true });
    };
    const gap = ui.chart(main, { height: 300, title: "Error above the bound", x: { label: "step k", range: [0, steps - 1] }, y: { label: "percent of the bound" }, says: "Error variance of each filter above the exact filter's, in percent, against the step, with 95 percent bands." });
    const size = ui.chart(main, { height: 300, title: "Error variance", x: { label: "step k", range: [0, steps - 1] }, y: { label: "mean square error", log: true }, left: 64, says: "Mean square error of each filter against the step, on a logarithmic scale." });
    const track = ui.chart(charts, { title: "One trajectory", x: { label: "step k", range: [0, steps - 1] }, y: { label: "state x" }, says: "One trajectory and all its estimates against the step." });
    const density = ui.chart(charts, { title: "What the exact filter knows at step k", x: { label: "state x" }, y: { label: "density" }, left: 64, says: "The exact posterior density at the chosen step, the Gaussian filter's normal density, the truth and the estimates." });
    const gains = ui.chart(charts, { title: "Gain at step k", x: { label: "prediction λ" }, y: { label: "gain dz/dy" }, says: "The gain of each filter against its prediction." });
    const functions = ui.chart(charts, { title: "Structural function", x: { label: "mean" }, y: { label: "value" }, left: 64, says: "The chosen structural function against the mean: Gaussian solid, linearised dashed." });
    const of = (chart, more = {}) => Object.fromEntries(names.map((one) => [one, chart.curve({ ...looks[one], ...more })]));
    const bands = Object.fromEntries(names.map((one) => [one, gap.band({ colour: looks[one].colour, opacity: 0.13 })]));
    const lines = { gap: of(gap), size: of(size), track: of(track, { width: 1.4 }), gains: of(gains) };
    const bound = size.curve({ width: 1.4 }), zero = gap.curve({ width: 1 }), truth = track.curve({ width: 2.4 }), known = track.curve({ width: 1.2, dash: "2 2" }), here = track.curve({ width: 1, dash: "2 3" });
    const posterior = density.curve({ width: 2 }), normal = density.curve({ ...looks["aof-gaussian"], width: 1.4 }), at = density.curve({ width: 1.2, dash: "4 3" });
    const places = Object.fromEntries(names.map((one) => [one, density.dots({ colour: looks[one].colour, size: 4 })]));
    const exactly = functions.curve({ ...looks["aof-gaussian"] }), tangent = functions.curve({ ...looks["aof-linearised"] });
    track.handle({
      keys: { x: "step" }, range: { x: [0, steps - 1] }, step: { x: 1 }, name: "Step to look at", value: ({ step }) => `step ${step}`,
      place: ({ step }) => [step, result ? result.track.x[step] : 0],
    });

    // What is shown is of one question, `answered`: until the one that has been `asked` is, it stays there in grey.
    let asked = "", answered = "", variant = "", result = null, bounds = null;
    const ask = ui.worker(ui.code, (data) => {
      if (data.kind === "errors") [result, bounds, answered] = [data, null, asked];
      else bounds = data;
      root.dataset.done = data.m ?? 0;
      ui.redraw();
    });
    const ks = Array.from({ length: steps }, (_, k) => k);
    const spanned = (values, share = 0.06) => {
      const finite = values.filter(isFinite), low = Math.min(...finite), high = Math.max(...finite), more = share * (high - low || Math.abs(high) || 1);
      return finite.length ? [low - more, high + more] : [0, 1];
    };
    const settings = (state) => {
      const values = Object.fromEntries(Object.keys(kfModels[state.variant].parameters).map((one) => [one, state[key(state.variant, one)]]));
      return { values, prior: { mean: state[key(state.variant, "prior-mean")], variance: state[key(state.variant, "prior-variance")] } };
    };

    const drawErrors = () => {
      const shown = bounds && result && bounds.number === result.number;
      const tops = [];
      for (const one of names) {
        const part = shown ? bounds.above[one] : ks.map(() => [NaN, NaN]), value = part.map(([ratio]) => 100 * ratio);
        const half = part.map(([, error]) => 100 * reach * error);
        lines.gap[one](ks, value);
        bands[one](ks, value.map((v, k) => v - half[k]), value.map((v, k) => v + half[k]));
        tops.push(...value.map((v, k) => v + half[k]).filter(isFinite));
        lines.size[one](ks, result.errors[one].map(([v]) => v));
      }
      zero(ks, ks.map(() => 0));
      if (shown) {
        const top = Math.min(Math.max(1e-3, ...tops), 200);
        gap.y([-0.08 * top, 1.05 * top]);
      }
      const exact = shown ? bounds.above[names[0]].map((part) => part[2]) : ks.map(() => NaN);
      bound(ks, exact);
      const sizes = names.flatMap((one) => result.errors[one].map(([v]) => v)).filter((v) => isFinite(v) && v > 0);
      const low = Math.min(...sizes), high = Math.min(Math.max(...sizes), 1e6 * low);
      size.y([low / 1.5, high * 1.5]);
    };
    const drawTrack = ({ step }) => {
      const { x, exact, z, p } = result.track;
      truth(ks, x);
      known(ks, exact.z);
      for (const one of names) lines.track[one](ks, z[one]);
      const range = spanned([...x.slice(0, steps), ...exact.z]);
      track.y(range);
      here([step, step], range);
      const law = exact.densities[step];
      const [m, v] = [z["aof-gaussian"][step], p[step]], sd = Math.sqrt(exact.p[step]);
      if (!law || !(sd > 0)) return;
      const xs = Array.from({ length: 161 }, (_, i) => exact.z[step] + (i - 80) * 0.06 * sd);
      posterior(law.x, law.density);
      normal(xs, xs.map((one) => Math.exp((-0.5 * (one - m) ** 2) / v) / Math.sqrt(2 * Math.PI * v)));
      const top = 1.15 * law.density.reduce((a, b) => Math.max(a, b));
      density.x([exact.z[step] - 4.8 * sd, exact.z[step] + 4.8 * sd]);
      density.y([0, top]);
      at([x[step], x[step]], [0, top]);
      names.forEach((one, i) => places[one]([z[one][step]], [top * (0.04 + 0.035 * i)]));
    };
    const drawFunctions = (state) => {
      const { variant: of, settings: { values } } = JSON.parse(answered), { step } = state, model = kfModels[of], n = 121;
      const [mean, sd] = result.state[step], spread = result.spread[step];
      const xs = Float64Array.from({ length: n }, (_, i) => mean + ((i - 60) / 20) * (sd || 1));
      const all = [];
      for (const one of names) {
        const [low, high] = [0, 1].map((y) => {  // all are affine in y: the gain is the difference of two estimates
          const a = { lambda: xs.slice(), Psi: new Float64Array(n).fill(spread), y: new Float64Array(n).fill(y), z: new Float64Array(n), p: new Float64Array(n) };
          model.filters[one].step(n, values, result.coefficients[one]?.[step] ?? {}, a);
          return a.z;
        });
        const gain = Array.from(high, (value, i) => value - low[i]);
        lines.gains[one](xs, gain);
        all.push(...gain);
      }
      gains.x([xs[0], xs[n - 1]]);
      gains.y(spanned(all));
      const d = new Float64Array(n).fill(spread), found = [];
      for (const [structure, line] of [["gaussian", exactly], ["linearised", tangent]]) {
        const a = { z: xs, p: d, m: xs, d, ...Object.fromEntries(["tau", "Theta", "h", "G", "F"].map((one) => [one, new Float64Array(n)])) };
        model[structure].predict(n, values, {}, a);
        model[structure].measure(n, values, {}, a);
        line(xs, a[state.function]);
        found.push(...a[state.function]);
      }
      functions.x([xs[0], xs[n - 1]]);
      functions.y(spanned(found));
    };
    const drawTable = ({ step }) => {
      const shown = result && bounds && bounds.number === result.number;
      const rows = names.map((one) => {
        const value = result?.errors[one][step][0], part = shown ? percent(...bounds.above[one][step]) : "…";
        return `<tr><th scope="row">${looks[one].label}</th><td>${!result ? "…" : isFinite(value) ? ui.short(value) : "diverges"}</td><td>${part}</td></tr>`;
      });
      table.innerHTML = `<table class="table"><thead><tr><th scope="col">step ${step}</th><th scope="col">error variance</th><th scope="col">above the bound (%)</th></tr></thead><tbody>${rows.join("")}</tbody></table>`;
    };

    return (state) => {
      if (!(state.variant in kfModels)) state.variant = given.first;
      if (variant !== state.variant) {
        variant = state.variant;
        controls(variant);
        for (const show of ui.shown) show(state);
      }
      const question = { variant, settings: settings(state), n: runs, steps, seed: state.seed, shown: state.shown };
      if (asked !== JSON.stringify(question)) {
        asked = JSON.stringify(question);
        ask(question);
      }
      const old = Boolean(result) && answered !== asked;
      root.classList.toggle("kf-old", old);
      if (!result) {  // both take the room that they need later
        status.textContent = `${thousands(runs)} trajectories of ${steps} steps, seven filters: they are being designed and compared. The bound is being computed.`;
        drawTable(state);
        return;
      }
      if (old) status.textContent = "In grey, the numbers before your change. The new ones are being computed.";
      else if (!result.finite) status.textContent = "With these numbers the trajectories themselves become infinite.";
      else
        status.textContent = `${thousands(runs)} trajectories of ${steps} steps, seven filters designed and compared: ${Math.round(result.milliseconds)}${SPACE}ms. `
          + (bounds ? `Bound by the exact filter on ${bounds.m} more.` : "The bound is being computed.");
      drawErrors();
      drawTrack(state);
      drawFunctions(state);
      drawTable(state);
    };
  });
};
