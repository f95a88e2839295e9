// Who is the most accurate: a map of leaders over the step and a ratio of noises, one cell of it under the reader's hand, and the
// filters of that cell in their order.  All numbers were computed by the book's code before.

const { INK } = kfFigure;
const TURNED = 0.4;  // share of the axis left of zero, for intervals and rounding

function kfWhoLeads(root, name, { ratios, gaps, leaders, trajectories, looks, kinds, first }) {
  const names = Object.keys(looks), steps = gaps[0].length;
  kfFigure(root, name, first, (ui) => {
    const charts = ui.row("kf-charts");
    const bars = ui.chart(charts, {
      title: "Error variance above the best possible (%)", says: "Bars of the filters, the most accurate on top, with 95 % intervals.",
      height: 290, left: 62, x: { label: "" }, y: { label: "", range: [-names.length + 0.4, 0.6], ticks: [] },
    });
    const map = ui.chart(charts, {
      title: "Who leads (small: not alone)", says: "Map over the step and over the ratio of the noises f over e: the colour of the most accurate filter in each cell.",
      height: 290, x: { label: "step k", range: [-0.5, steps - 0.5], ticks: Array.from({ length: steps }, (_, k) => [k, String(k)]) },
      y: { label: "f/e, meter against object", range: [-0.5, ratios.length - 0.5], ticks: ratios.map((one, i) => [i, String(one)]) },
    });
    const one = Object.fromEntries(names.map((key) => [key, {
      bar: bars.curve({ colour: looks[key].colour, width: 17 }), label: bars.text({ anchor: "end" }), said: bars.text(),
      alone: map.dots({ colour: looks[key].colour, size: 11 }), shared: map.dots({ colour: looks[key].colour, size: 5 }),
    }]));
    const whiskers = bars.curve({ colour: INK, width: 1.4 });
    ui.legend(kinds);
    const says = ui.says();
    map.handle({
      keys: { x: "k", y: "ratio" }, range: { x: [0, steps - 1], y: [0, ratios.length - 1] }, step: { x: 1, y: 1 }, colour: INK, name: "Step and ratio f/e",
      place: (state) => [state.k, state.ratio], value: (state) => `step ${state.k}, f/e = ${ratios[state.ratio]}`,
    });
    const cells = (key, alone) => leaders.flatMap((row, i) => row.flatMap(([best, more], k) => (best === key && (more === 0) === alone ? [[k, i]] : [])));
    return ({ k, ratio }) => {
      const found = gaps[ratio][k], order = [...names].sort((a, b) => found[a][0] - found[b][0]);
      const most = Math.max(...order.map((key) => found[key][2])), unit = most / 100, least = Math.min(0, ...order.map((key) => found[key][1]));
      bars.x([least - unit, most + TURNED * most]);
      order.forEach((key, place) => {
        const [middle, , high] = found[key], of = one[key];
        of.bar([0, middle], [-place, -place]);
        of.label(least - 2 * unit, -place - 0.1, looks[key].label);
        of.said(high + 2 * unit, -place - 0.1, middle < 10 ? middle.toFixed(2).replace("-", "−") : middle.toFixed(0));
        of.alone(...[0, 1].map((axis) => cells(key, true).map((cell) => cell[axis])));
        of.shared(...[0, 1].map((axis) => cells(key, false).map((cell) => cell[axis])));
      });
      whiskers(order.flatMap((key) => [found[key][1], found[key][2], NaN]), order.flatMap((_, place) => [-place, -place, NaN]));
      const [best, more] = leaders[ratio][k];
      says.textContent = `Step ${k}, f/e = ${ratios[ratio]}: ${looks[best].label} ${more === 0 ? "leads" : `leads, ${more} not significantly worse`}; `
        + `last ${looks[order.at(-1)].label}, ${found[order.at(-1)][0].toFixed(1).replace("-", "−")} % above the best possible. `
        + `95 % intervals, of ${trajectories} exact trajectories; who leads is judged by differences on the same trajectories, which are surer than the bars.`;
    };
  });
}
