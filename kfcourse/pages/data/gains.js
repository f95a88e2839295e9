// Gains of filters over the prediction, and the estimates that they make of a measurement, with both under the reader's hand:
// values of expressions that SymPy printed, nothing else.

const { values, BAND } = kfFigure;
const N = 241, REACH = 3, WIDE = 4;
const evenly = (reach) => Float64Array.from({ length: N }, (_, i) => (reach * (2 * i - N + 1)) / (N - 1));
const predicted = evenly(REACH), measured = evenly(WIDE);

function kfGains(root, name, { first, variances, dots, looks }) {
  const names = Object.keys(filters), leader = filters[names[0]];
  const gain = (one, state) => values(one.gain, { lambda: [state.lambda] }, state)[0];
  const estimate = (one, state) => values(one.estimate, { y: [state.y] }, state)[0];
  kfFigure(root, name, first, (ui) => {
    const charts = ui.row("kf-charts"), height = 270;
    const left = ui.chart(charts, {
      title: "The gain", says: "Gain of each filter against its prediction: two bells and a horizontal line.",
      height, x: { label: "prediction λ", range: [-REACH, REACH] }, y: { label: "gain", range: [0, 1.05] },
    });
    const right = ui.chart(charts, {
      title: "The estimate", says: "Estimate of each filter against the measurement: straight lines of different slopes.",
      height, x: { label: "measurement y", range: [-WIDE, WIDE] }, y: { label: "estimate z", range: [-WIDE, WIDE] },
    });
    const cloud = left.dots({ colour: BAND, size: 1.5 });
    const lines = names.map((one) => ({ of: filters[one], gain: left.curve(looks[one]), estimate: right.curve(looks[one]), ...looks[one] }));
    ui.legend([...lines, { label: `${lines[0].label} on trajectories`, colour: BAND, dash: "2 4", width: 4 }]);
    ui.slider(ui.row(), "p", { label: `p before, of the ${lines[0].label}`, low: variances[0], high: variances[1], log: true });
    const says = ui.says();
    left.handle({
      keys: { x: "lambda" }, range: { x: [-2.8, 2.8] }, step: { x: 0.05 }, colour: lines[0].colour, name: "Prediction λ",
      place: (state) => [state.lambda, gain(leader, state)], value: (state) => ui.short(state.lambda),
    });
    right.handle({
      keys: { x: "y" }, range: { x: [-3.8, 3.8] }, step: { x: 0.05 }, colour: lines[0].colour, name: "Measurement y",
      place: (state) => [state.y, estimate(leader, state)], value: (state) => ui.short(state.y),
    });
    return (state) => {
      cloud(...dots);
      for (const one of lines) {
        one.gain(predicted, values(one.of.gain, { lambda: predicted }, state));
        one.estimate(measured, values(one.of.estimate, { y: measured }, state));
      }
      const told = (what) => lines.map((one) => `${one.label} ${what(one.of, state).toFixed(3).replace("-", "−")}`).join(", ");
      says.textContent = `λ = ${ui.short(state.lambda)}, y = ${ui.short(state.y)}. Gains: ${told(gain)}. Estimates: ${told(estimate)}.`;
    };
  });
}
