"""From two formulas to compiled functions; everything here knows SymPy, and nothing of filters.

formula     formulas typed by people, read without executing them
model       `Model`: object, meter, noises, prior
moments     exact moments of functions of normal variables
structure   structural functions tau, Theta, h, G, F: derived or by quadrature
codegen     expressions -> NumPy over the ensemble; the only place where formulas become code
"""
