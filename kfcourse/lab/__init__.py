"""The lab: its variants, its filters by short name, whether a variant is well posed, figures and
report.

variants     `Variant`, read from variants.toml or a file like it
admission    which filters a model admits, and why not
families     what each family of filters is called, in both languages, and how it is drawn
short_names  the lab's filters: "duof" -> how to build it, "DUOF" in tables;  checked_quadrature:
             where there are no formulas
quality      is a variant well posed?  grammar: new ones, from the pieces of grammar.toml
plots        figures of a comparison, one colour and name for each filter
report       what `kfcourse lab` writes, its JSON too, in English or Russian (report.toml);
             report_sections: from the task to the conclusion; report_modes: what is otherwise
             of models with modes; report_text: numbers, sentences, the AOF's equations with
             the model's functions in them
own_data     what `kfcourse estimate` writes of a record from a file
"""

from kfcourse.lab.short_names import FILTERS, LAB, Structures, has_exact, lab_filters, title
from kfcourse.lab.variants import Variant, VariantError, find_variant, load_variants, read_variant

__all__ = [
    "FILTERS",
    "LAB",
    "Structures",
    "Variant",
    "VariantError",
    "find_variant",
    "has_exact",
    "lab_filters",
    "load_variants",
    "read_variant",
    "title",
]
