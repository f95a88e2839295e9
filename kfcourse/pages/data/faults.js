// A filter with the noises of a wrong model, its three tests, and a reader who says what is wrong: the filter is the lab's, the tests
// are values of expressions that SymPy printed.

const { values, INK, BLUE, BAND, ORANGE } = kfFigure;
const RANGE = [0.2, 20], NONE = "–";

function kfFaults(root, name, { x, y, faults, hidden, bounds }) {
  const n = x[0].length, steps = x.map((_, k) => k), lags = Array.from({ length: bounds.correlation[0].length }, (_, l) => l + 1);
  const average = (one) => one.reduce((sum, value) => sum + value, 0) / one.length;
  const { c, e, g, f } = model.parameters;
  const test = (q, r) => {
    const v = { c, e: e * Math.sqrt(q), g, f: f * Math.sqrt(r) }, filled = (value) => new Float64Array(n).fill(value);
    const a = { lambda: filled(model.prior.mean), Psi: filled(model.prior.variance), z: filled(0), p: filled(0) }, whitened = [], found = { nees: [], nis: [] };
    y.forEach((measured, k) => {
      const before = { m: a.lambda.slice(), d: a.Psi.slice(), h: filled(0), G: filled(0), F: filled(0) };
      model.linearised.measure(n, v, {}, before);
      whitened.push(values(white, { y: measured, h: before.h, F: before.F }));
      a.y = measured;
      model.filters["aof-linearised"].step(n, v, {}, a);
      found.nis.push(average(whitened[k].map((one) => one * one)));
      found.nees.push(average(values(nees, { x: x[k], z: a.z, p: a.p })));
    });
    const all = average(found.nis);
    found.correlation = lags.map((lag) => average(whitened.slice(lag).map((one, k) => average(one.map((value, i) => value * whitened[k][i])))) / all);
    return found;
  };
  const first = { q: 1, r: 1, case: hidden[0][0], guess: NONE }, fault = Object.fromEntries(hidden.map(([key, , kind]) => [key, kind]));
  kfFigure(root, name, first, (ui) => {
    const charts = ui.row("kf-charts"), height = 230, ratio = { log: true, range: RANGE, ticks: [0.2, 0.5, 1, 2, 5, 10, 20].map((one) => [one, String(one)]) };
    charts.style.setProperty("--kf-least", "13rem");  // three beside each other
    const along = { label: "step k", range: [0, steps.length - 1] };
    const each = [
      ["nees", "NEES: asks the truth", along, { label: "mean over its due", ...ratio }, steps],
      ["nis", "NIS: asks the record", along, { label: "mean over its due", ...ratio }, steps],
      ["correlation", "Correlation of innovations", { label: "steps apart", range: [0.5, lags.length + 0.5] }, { label: "correlation", range: [-0.6, 1] }, lags],
    ].map(([key, title, x, y, at]) => {
      const chart = ui.chart(charts, { title, height, x, y, says: `${title}: the filter's, with the band in which nineteen of twenty right ones are.` });
      const limits = chart.band({ colour: "#999999", opacity: 0.35 });
      const guess = chart.curve({ colour: ORANGE, width: 1.6, dash: "5 3" }), line = chart.curve({ colour: BLUE, width: 2 });
      return { key, at, show: () => limits(at, ...bounds[key]), line, guess };
    });
    ui.legend([
      { label: "the filter", colour: BLUE }, { label: "95 % of right ones", colour: "#999999", width: 8, opacity: 0.35 },
      { label: "what you say is wrong, by itself", colour: ORANGE, dash: "5 3" },
    ]);
    const controls = ui.row();
    ui.shown.push(Object.assign((state) => {  // another filter, another guess
      if (state.case !== ui.before && ui.before) state.guess = NONE;
      ui.before = state.case;
    }, { within: null }));
    ui.choice(controls, "case", { label: "Filter", options: hidden.map(([key, label]) => [key, label]) });
    ui.choice(controls, "guess", { label: "Which is wrong?", options: [NONE, ...Object.keys(faults)].map((one) => [one, one]) });
    for (const [key, letter] of [["q", "Q"], ["r", "R"]])
      ui.slider(controls, key, { label: `Multiply its ${letter} by`, low: 0.1, high: 10, log: true });
    const says = ui.says();
    return (state) => {
      const kind = fault[state.case] ?? fault[first.case], of = (which) => test(faults[which][0] * state.q, faults[which][1] * state.r);
      const guessed = state.guess in faults ? of(state.guess) : null, found = of(kind);
      for (const one of each) {
        one.show();
        one.line(one.at, found[one.key]);
        one.guess(one.at, guessed ? guessed[one.key] : one.at.map(() => NaN));
      }
      const say = (value) => value.toFixed(2).replace("-", "−");
      const verdict = !guessed ? "" : state.guess === kind ? ` Yes: ${kind}.` : ` No: with “${state.guess}” they would be the dashed ones.`;
      says.textContent = `NEES ${say(average(found.nees))}, NIS ${say(average(found.nis))} times their due; `
        + `correlation of neighbours ${say(found.correlation[0])}.${verdict}`;
    };
  });
}
