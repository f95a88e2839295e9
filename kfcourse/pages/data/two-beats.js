// Correction and prediction on a line, with the measurement y under the reader's hand: product and integral, of densities that
// SymPy printed.

const N = 321, LOW = -6, HIGH = 6;
const { values, INK, BLUE, BAND, ORANGE } = kfFigure;
const x = Float64Array.from({ length: N }, (_, i) => (LOW * (N - 1 - i) + HIGH * i) / (N - 1)), step = (HIGH - LOW) / (N - 1);
const sum = (a) => a.reduce((one, other) => one + other, 0);

function kfTwoBeats(root, name, first) {
  const before = values(prior, { x });
  const kernel = values(transition, { x: Float64Array.from({ length: N * N }, (_, i) => x[i % N]), next: Float64Array.from({ length: N * N }, (_, i) => x[(i / N) | 0]) });
  const distance = (at) => values(place, { x: Float64Array.of(at) })[0];
  const REACH = [0, 5.5];
  // The handle is where the measurement would be exact: the place to the right at which the distance is y.
  const places = Float64Array.from({ length: 551 }, (_, i) => i / 100), off = values(place, { x: places }).map((one) => Math.abs(one - first));
  const start = places[off.indexOf(Math.min(...off))];
  kfFigure(root, name, { place: start }, (ui) => {
    const charts = ui.row("kf-charts"), says = ui.says();
    const axis = { label: "position x (km)", range: [LOW, HIGH] };
    const [left, right] = [["A measurement comes", "Prior, likelihood and posterior density over the position."], ["Time passes", "Posterior density, and the density predicted from it."]]
      .map(([title, text]) => ui.chart(charts, { title, says: text, height: 260, x: axis, y: { label: "density (1/km)" } }));
    const lines = {
      prior: left.band({ colour: BAND, opacity: 0.5 }), likelihood: left.curve({ colour: ORANGE }), posterior: left.curve({ colour: INK, width: 2 }),
      mean: left.curve({ colour: BLUE, width: 1.6, dash: "5 3" }), after: right.curve({ colour: INK, width: 1 }), predicted: right.band({ colour: BAND, opacity: 0.5 }),
      next: right.curve({ colour: BLUE, width: 1.6, dash: "5 3" }),
    };
    ui.legend([{ label: "prior; prediction", colour: BAND, width: 8, opacity: 0.5 }, { label: "likelihood, not to scale", colour: ORANGE }, { label: "posterior", colour: INK }, { label: "mean", colour: BLUE, dash: "5 3" }]);
    const top = 0.42;
    left.handle({
      keys: { x: "place" }, range: { x: REACH }, step: { x: 0.02 }, colour: ORANGE, name: "Measured distance",
      place: (state) => [state.place, top], value: (state) => `${distance(state.place).toFixed(2)} km`,
    });
    return (state) => {
      const y = distance(state.place), fits = values(likelihood, { x }, { y });
      const product = before.map((one, i) => one * fits[i]), whole = sum(product) * step, posterior = product.map((one) => one / whole);
      const predicted = x.map((_, i) => {
        let total = 0;
        for (let j = 0; j < N; j++) total += posterior[j] * kernel[N * i + j];
        return step * total;
      });
      const most = fits.reduce((a, b) => Math.max(a, b)), none = x.map(() => 0), high = 1.05 * Math.max(1, ...posterior, ...predicted);
      const mean = (density) => step * sum(density.map((one, i) => one * x[i]));
      lines.prior(x, none, before);
      lines.likelihood(x, fits.map((one) => (one / most) * 0.4));
      lines.posterior(x, posterior);
      lines.mean([mean(posterior), mean(posterior)], [0, high]);
      lines.after(x, posterior);
      lines.predicted(x, none, predicted);
      lines.next([mean(predicted), mean(predicted)], [0, high]);
      for (const one of [left, right]) one.y([0, high]);
      const at = posterior[Math.round((mean(posterior) - LOW) / step)], share = step * sum(posterior.map((one, i) => one * (1 - Math.sign(x[i])) / 2));
      says.textContent = `y = ${y.toFixed(2)}\u00a0km. ${Math.round(100 * share)}\u00a0% of the probability is left of the beacon. `
        + `Mean ${ui.short(Number(mean(posterior).toFixed(2)))}\u00a0km, where the density is ${ui.short(Number(at.toFixed(3)))}; its top is ${ui.short(Number(Math.max(...posterior).toFixed(2)))}.`;
    };
  });
}
