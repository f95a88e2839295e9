// A filter over a record of which one measurement is under the reader's hand, with the noises that the filter believes in: its step
// is what SymPy printed.

const { INK, BLUE, BAND, ORANGE } = kfFigure;
const REACH = 7;

function kfOneMeasurement(root, name, { x, y, at, prior, first, noises }) {
  const steps = x.map((_, k) => k);
  const follow = (measured, c) => {
    const a = { lambda: [prior[0]], Psi: [prior[1]], y: [0], z: [0], half: [0] }, found = { z: [], half: [] };
    for (const one of measured) {
      a.y[0] = one;
      step(1, {}, c, a);
      for (const key of ["z", "half"]) found[key].push(a[key][0]);
    }
    return found;
  };
  kfFigure(root, name, first, (ui) => {
    const axis = { label: "step k", range: [0, x.length - 1] };
    const chart = ui.chart(ui.row("kf-charts"), {
      height: 280, x: axis, y: { label: "state", range: [-REACH, REACH] },
      says: "The state, its measurements of which one can be moved, and the filter's estimate with its 95 % band.",
    });
    const below = ui.chart(ui.row("kf-charts"), {
      height: 140, x: axis, y: { label: "half width" }, says: "Half the width of the band at each step: the same wherever the measurement is.",
    });
    const lines = {
      band: chart.band({ colour: BAND, opacity: 0.35 }), dots: chart.dots({ colour: "#999999" }), before: chart.curve({ colour: BLUE, width: 1.3, dash: "4 3" }),
      estimate: chart.curve({ colour: BLUE, width: 2 }), truth: chart.curve({ width: 1.2 }),
      half: below.curve({ colour: BAND, width: 5 }), halfBefore: below.curve({ colour: BLUE, width: 1.3, dash: "4 3" }),
    };
    ui.legend([
      { label: "state", colour: INK }, { label: "estimate, band", colour: BLUE }, { label: "as the meter said", colour: BLUE, dash: "4 3", width: 1.3 },
      { label: "the measurement that you move", colour: ORANGE, width: 3 },
    ]);
    const controls = ui.row();
    for (const [key, label] of [["Q", "Q, of the kicks"], ["R", "R, of the meter"]])
      ui.slider(controls, key, { label, low: noises[0], high: noises[1], log: true });
    const says = ui.says();
    chart.handle({
      keys: { y: "y" }, range: { y: [1 - REACH, REACH - 1] }, step: { y: 0.1 }, colour: ORANGE, name: `Measurement at step ${at}`,
      place: (state) => [at, state.y], value: (state) => ui.short(state.y),
    });
    return (state) => {
      const moved = follow(y.map((one, k) => (k === at ? state.y : one)), state), before = follow(y, state);
      lines.band(steps, moved.z.map((one, k) => one - moved.half[k]), moved.z.map((one, k) => one + moved.half[k]));
      lines.dots(...[steps, y].map((all) => all.filter((_, k) => k !== at)));
      lines.before(steps, before.z);
      lines.estimate(steps, moved.z);
      lines.truth(steps, x);
      lines.half(steps, moved.half);
      lines.halfBefore(steps, before.half);
      below.y([0, 1.25 * Math.max(...moved.half)]);
      const say = (value) => value.toFixed(2).replace("-", "−");
      says.textContent = `Measured at step ${at}: ${say(state.y)}. Estimate ${say(moved.z[at])} ± ${say(moved.half[at])}; `
        + `with ${say(y[at])}, as the meter said, ${say(before.z[at])} ± ${say(before.half[at])}.`;
    };
  });
}
