// A signal, its tangent and the line that is best on average, with the mean of the state under the reader's hand: values of
// expressions that SymPy printed, nothing else.

const { values, INK, BLUE, BAND, ORANGE } = kfFigure;
const N = 261, LOW = -2.5, HIGH = 4, FLOOR = -2;
const x = Float64Array.from({ length: N }, (_, i) => (LOW * (N - 1 - i) + HIGH * i) / (N - 1));

function kfTwoLines(root, name, first) {
  kfFigure(root, name, first, (ui) => {
    const chart = ui.chart(ui.row("kf-charts"), {
      height: 290, x: { label: "x (rad)", range: [LOW, HIGH] }, y: { label: "signal", range: [FLOOR, 2] },
      says: "A signal, its tangent at the mean of the state, the line that is best on average, and the density of the state.",
    });
    const lines = {
      density: chart.band({ colour: INK, opacity: 0.2 }), left: chart.band({ colour: BAND, opacity: 0.35 }), signal: chart.curve(),
      tangent: chart.curve({ colour: BLUE, dash: "6 4" }), best: chart.curve({ colour: BLUE }),
    };
    ui.legend([
      { label: "signal", colour: INK }, { label: "tangent", colour: BLUE, dash: "6 4" }, { label: "best on average", colour: BLUE },
      { label: "what it leaves, root mean square", colour: BAND, width: 8, opacity: 0.35 }, { label: "density of x", colour: INK, width: 8, opacity: 0.2 },
    ]);
    ui.slider(ui.row(), "variance", { label: "Ψ, variance of x (rad²)", low: 0.02, high: 1, step: 0.02 });
    const says = ui.says();
    chart.handle({
      keys: { x: "mean" }, range: { x: [-2, 3.5] }, step: { x: 0.05 }, colour: ORANGE, name: "λ, mean of x",
      place: (state) => [state.mean, values(signal, { x: [state.mean] })[0]], value: (state) => `${ui.short(state.mean)} rad`,
    });
    return (state) => {
      const shown = (of) => values(of, { x }, state), middle = shown(best);
      const told = Object.fromEntries(["tangentMean", "tangentSlope", "bestMean", "bestSlope", "left"].map((key) => [key, [0]]));
      numbers(1, {}, state, told);
      const size = Math.sqrt(told.left[0]), say = ([one]) => ui.short(Number(one.toFixed(3)));
      lines.signal(x, shown(signal));
      lines.density(x, x.map(() => FLOOR), shown(density).map((one) => FLOOR + 0.5 * one));
      lines.tangent(x, shown(tangent));
      lines.best(x, middle);
      lines.left(x, middle.map((one) => one - size), middle.map((one) => one + size));
      says.textContent = `λ = ${ui.short(state.mean)}, Ψ = ${ui.short(state.variance)}. `
        + `The tangent says: mean ${say(told.tangentMean)}, slope ${say(told.tangentSlope)}, and nothing left over. `
        + `Best on average: mean ${say(told.bestMean)}, slope ${say(told.bestSlope)}, left over ±${say([size])}.`;
    };
  });
}
