// The error of a phase loop as a ball on the potential of its discriminator, and its trace: one step and the potential are what SymPy
// printed.

const { values, INK, BLUE, ORANGE } = kfFigure;
const N = 401, TURN = 2 * Math.PI, TRAIL = 25;

function kfSlip(root, name, { noises, first, range }) {
  const steps = noises[0][0].length, along = Array.from({ length: steps + 1 }, (_, k) => k);
  const trace = (c, [n, v]) => {
    const a = { Delta: [0], n: [0], v: [0] }, found = [0];
    for (let k = 0; k < steps; k++) {
      [a.n[0], a.v[0]] = [n[k], v[k]];
      step(1, {}, c, a);
      found.push(a.Delta[0]);
    }
    return found;
  };
  kfFigure(root, name, first, (ui) => {
    const charts = ui.row("kf-charts"), height = 270;
    const left = ui.chart(charts, {
      title: "The ball", says: "Potential of the discriminator over the error, with a valley at each whole cycle, and the error at one step as a ball.",
      height, x: { label: "error Δ (cycles)" }, y: { label: "potential V" },
    });
    const right = ui.chart(charts, {
      title: "The trace", says: "The error of the loop over the steps, in cycles.",
      height, x: { label: "step k", range: [0, steps] }, y: { label: "error Δ (cycles)" },
    });
    const hills = left.curve({ width: 1.6 }), trail = left.curve({ colour: BLUE, width: 1 }), ball = left.dots({ colour: ORANGE, size: 8 });
    const line = right.curve({ colour: BLUE, width: 1.3 }), ridges = right.curve({ colour: INK, width: 1, dash: "4 4" });
    ui.legend([
      { label: "potential", colour: INK }, { label: "error; its last steps", colour: BLUE }, { label: "unstable zeros, between cycles", colour: INK, dash: "4 4", width: 1 },
    ]);
    const controls = ui.row();
    ui.slider(controls, "sigma", { label: "σ of the meter (V)", low: range[0], high: range[1], step: 0.05 });
    ui.slider(controls, "draw", { label: "Random numbers", low: 1, high: noises.length, step: 1, say: String });
    const says = ui.says();
    right.handle({
      keys: { x: "k" }, range: { x: [0, steps] }, step: { x: 1 }, colour: ORANGE, name: "Step to look at",
      place: (state) => [state.k, trace(state, noises[state.draw - 1])[state.k] / TURN], value: (state) => `step ${state.k}`,
    });
    return (state) => {
      const found = trace(state, noises[state.draw - 1]), cycles = found.map((one) => one / TURN);
      const low = Math.min(-0.7, ...cycles.map((one) => one - 0.2)), high = Math.max(0.7, ...cycles.map((one) => one + 0.2));
      const over = Float64Array.from({ length: N }, (_, i) => low + ((high - low) * i) / (N - 1)), height = (at) => values(potential, { Delta: at }, state);
      const hill = height(over.map((one) => TURN * one)), top = height([TURN / 2])[0], V = height(found), past = Math.max(0, state.k - TRAIL);
      left.x([low, high]);
      left.y([-0.05 * top, 1.25 * top]);
      right.y([low, high]);
      hills(over, hill);
      trail(cycles.slice(past, state.k + 1), Array.from(V.slice(past, state.k + 1)));
      ball([cycles[state.k]], [V[state.k]]);
      line(along, cycles);
      const between = Array.from({ length: Math.ceil(high - low) + 2 }, (_, i) => Math.floor(low) + i + 0.5);
      ridges(between.flatMap(() => [0, steps, NaN]), between.flatMap((one) => [one, one, NaN]));
      const whole = cycles.map(Math.round), lost = Math.abs(whole[steps]), say = (value) => value.toFixed(2).replace("-", "−");
      says.textContent = `Step ${state.k}: error ${say(cycles[state.k])} cycles; the hills are ${say(top)} high. `
        + `At the end ${lost === 0 ? "no cycle is" : lost === 1 ? "one cycle is" : `${lost} cycles are`} lost.`;
    };
  });
}
