"""From two formulas to compiled functions; everything here knows SymPy, and nothing of filters.

formula      formulas typed by people, read without executing them
reading      the other things that people write of a model: names, numbers, laws
known        what is known of every step: its number, its time, inputs; functions that depend on it
model        `Model`: object, meter, noises, prior, angles
jumping      `JumpModel`, several models and a chain
equations    its two equations as functions of arrays
moments      exact moments of functions of normal variables
sides        object and meter at a normal law, in symbols; where derivations by hand start, too;
             formulas with kinks and jumps
structure    structural functions tau, Theta, h, G, F, derived from these: `linearised`, `gaussian`
quadrature   the same by quadrature: `unscented`, `gauss_hermite`;  averaging: averaged over modes
codegen      expressions -> NumPy over the ensemble; the only place where formulas become code
javascript   the same programs as JavaScript, for the pages
"""
