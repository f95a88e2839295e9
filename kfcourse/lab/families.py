"""The families of filters: what each is called, in both languages, and how it is drawn.  One record
a family.

Filters of a family share its equations (`kfcourse.filters.EQUATIONS`, by the same name), colour and
marker, and differ in their structural functions (dashes) or in the length of their memory.
"""

from __future__ import annotations

from typing import NamedTuple


class Family(NamedTuple):
    """Names of a family and its look in figures.

    title, russian            in tables: "FOS", "ФОС"
    heading, russian_heading  of the section with its equations in reports; "" if `EQUATIONS` has
                              none of it
    colour, marker            Matplotlib's
    """

    title: str
    russian: str
    heading: str = ""
    russian_heading: str = ""
    colour: str = "#555555"
    marker: str = "."


# In the order of the course.  Okabe and Ito's colours and Tol's muted ones, and darker ones for
# those that are faint on paper.
FAMILIES: dict[str, Family] = {
    "kalman": Family("Kalman", "ФК", colour="#000000", marker="x"),
    "aof": Family(
        "AOF",
        "АОФ",
        "AOF, approximations of the absolutely optimal filter",
        "Приближения абсолютно оптимального фильтра (АОФ)",
        "#0072B2",
        "o",
    ),
    "duof": Family(
        "DUOF",
        "ДУОФ",
        "DUOF, the two-step conditionally optimal filter",
        "Двухшаговый условно-оптимальный фильтр (ДУОФ)",
        "#D55E00",
        "s",
    ),
    "fos": Family(
        "FOS",
        "ФОС",
        "FOS, the filter of optimal structure",
        "Фильтр оптимальной структуры (ФОС)",
        "#009E73",
        "^",
    ),
    "mfos": Family(
        "MFOS",
        "МФОС",
        "MFOS, the modified filter of optimal structure",
        "Модифицированный фильтр оптимальной структуры (МФОС)",
        "#CC79A7",
        "D",
    ),
    "dfmp": Family(
        "DFMP",
        "ДФМП",
        "DFMP, the two-step filter of low order",
        "Двухшаговый фильтр малого порядка (ДФМП)",
        "#882255",
        "<",
    ),
    "mdfmp": Family(
        "MDFMP",
        "МДФМП",
        "MDFMP, the modified two-step filter of low order",
        "Модифицированный двухшаговый фильтр малого порядка (МДФМП)",
        "#590059",
        ">",
    ),
    "fkp": Family(
        "FKP",
        "ФКП",
        "FKP, the filter with finite memory",
        "Фильтр с конечной памятью (ФКП)",
        "#117733",
        "p",
    ),
    "mfkp": Family(
        "MFKP",
        "МФКП",
        "MFKP, the modified filter with finite memory",
        "Модифицированный фильтр с конечной памятью (МФКП)",
        "#999933",
        "h",
    ),
    "dfkp": Family(
        "DFKP",
        "ДФКП",
        "DFKP, the two-step filter with finite memory",
        "Двухшаговый фильтр с конечной памятью (ДФКП)",
        "#0091F2",
        "H",
    ),
    "mdfkp": Family(
        "MDFKP",
        "МДФКП",
        "MDFKP, the modified two-step filter with finite memory",
        "Модифицированный двухшаговый фильтр с конечной памятью (МДФКП)",
        "#332288",
        "8",
    ),
    "fbp": Family(
        "FBP",
        "ФБП",
        "FBP, the filter of high order",
        "Фильтр большого порядка (ФБП)",
        "#661100",
        "X",
    ),
    "particle": Family("particle", "АОФ (частицы)", colour="#4C3900", marker="*"),
    "imm": Family("IMM", "АОФлд (смешивание до прогноза)", colour="#D55E00"),
    "gpb2": Family("GPB2", "АОФлд (пары режимов)", colour="#009E73"),
    "iterated": Family("iterated EKF", "итерационный РФК", colour="#B87500"),
    "alpha-beta": Family("alpha-beta", "альфа-бета", colour="#B87500"),
    "alpha-beta-gamma": Family("alpha-beta-gamma", "альфа-бета-гамма", colour="#B87500"),
    # where three arguments of the FOS's gain stand beside two, they have a look of their own
    "fos3": Family("FOS3", "ФОС, 3 арг.", colour="#8F33FF", marker="v"),
    "mfos3": Family("MFOS3", "МФОС, 3 арг.", colour="#664400", marker="P"),
}


def look(family: str) -> tuple[str, str]:
    """Colour and marker of a family."""
    return FAMILIES.get(family, Family(family, family))[4:]
