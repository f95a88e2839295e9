// A density and its masses on nodes, whose distance is under the reader's hand.

const { values, INK, BLUE, BAND, ORANGE } = kfFigure;
const N = 1601, TRIED = 240;

function kfGridStep(root, name, { first, low, high, least, most }) {
  // Masses of nodes at the multiples of h, and what a filter makes of them.
  const onGrid = (h) => {
    const count = Math.floor(high / h + 1e-9), start = Math.ceil(low / h - 1e-9);
    const x = Float64Array.from({ length: count - start + 1 }, (_, i) => (start + i) * h), mass = values(density, { x });
    const all = mass.reduce((one, other) => one + other, 0), of = (value) => x.reduce((sum, one, i) => sum + (mass[i] * value(one)) / all, 0);
    const mean = of((one) => one);
    return { x, mass: mass.map((one) => one / all), mean, sd: Math.sqrt(of((one) => (one - mean) ** 2)) };
  };
  const fine = (high - low) / (N - 1), right = onGrid(fine), top = right.mass.reduce((one, other) => Math.max(one, other)) / fine;
  const tried = Float64Array.from({ length: TRIED }, (_, i) => least + ((most - least) * i) / (TRIED - 1)), found = Array.from(tried, onGrid);
  kfFigure(root, name, { h: first }, (ui) => {
    const charts = ui.row("kf-charts"), height = 280;
    const left = ui.chart(charts, {
      title: "Masses on the nodes", says: "The density, and the masses on the nodes, each as a bar of mass over step.",
      height, x: { label: "position (km)", range: [low, high] }, y: { label: "density (1/km)" },
    });
    const steps = ui.chart(charts, {
      title: "What the filter says", says: "Mean and standard deviation by the nodes against their distance: right for small ones, then astray.",
      height, x: { label: "distance h of the nodes (km)", range: [0, most] }, y: { label: "mean ± s.d. (km)", range: [low, high] },
    });
    const bars = left.curve({ colour: BLUE, width: 4 }), line = left.curve({ width: 1.2 }), mean = left.curve({ colour: ORANGE, width: 2, dash: "5 3" });
    const claimed = steps.band({ colour: BAND, opacity: 0.35 }), means = steps.curve({ colour: BLUE }), exact = steps.curve({ width: 1.2 });
    const now = steps.dots({ colour: ORANGE, size: 5 });
    ui.legend([
      { label: "density; its mean", colour: INK, width: 1.2 }, { label: "masses; what they say", colour: BLUE, width: 3 },
      { label: "their mean", colour: ORANGE, dash: "5 3" },
    ]);
    const says = ui.says();
    left.handle({
      keys: { x: "h" }, range: { x: [least, most] }, step: { x: 0.05 }, colour: ORANGE, name: "Distance of the nodes: the first one right of zero",
      place: (state) => [state.h, 0], value: (state) => `${ui.short(state.h)} km`,
    });
    return ({ h }) => {
      const one = onGrid(h), heaviest = one.mass.reduce((a, b) => Math.max(a, b)), high_ = 1.08 * Math.max(top, heaviest / h);
      line(right.x, right.mass.map((mass) => mass / fine));
      bars(Array.from(one.x).flatMap((x) => [x, x, NaN]), Array.from(one.mass).flatMap((mass) => [0, mass / h, NaN]));
      mean([one.mean, one.mean], [0, high_]);
      left.y([0, high_]);
      claimed(tried, found.map((of) => of.mean - of.sd), found.map((of) => of.mean + of.sd));
      means(tried, found.map((of) => of.mean));
      exact([0, most], [right.mean, right.mean]);
      now([h], [one.mean]);
      const say = (value) => value.toFixed(2).replace("-", "−");
      says.textContent = `h = ${say(h)} km, ${one.x.length} nodes; the heaviest holds ${Math.round(100 * heaviest)} %. `
        + `Mean ${say(one.mean)} ± ${say(one.sd)} km; of the density itself ${say(right.mean)} ± ${say(right.sd)} km.`;
    };
  });
}
