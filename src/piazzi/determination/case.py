"""Every option of a determination, said once: the command line, `determine` and the keys of a case are made of this table."""

# ruff: noqa: RUF009  # fields of the table are made by a function
from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

from piazzi.determination import case_values as read
from piazzi.text import brief, nearest, one_line

if TYPE_CHECKING:
    from piazzi.determination.published import Published

# What files leave open, by the names that `read_tracking` takes; `cli.conventions` has their lines of help
ANSWERS = (
    "range", "angles", "tag", "frame", "corrections", "interval", "interval_reference", "repair", "range_unit", "time", "sigma",
    "scale", "columns", "debias",
)  # fmt: skip


@dataclass(frozen=True)
class Option:
    """One option.

    Attributes
    ----------
    metavar : of its value; "" for what is either said or not
    help : one line
    read : checks a value, text or object, and makes what `Case` holds of it; the second argument is where it was said
    many : whether it may be given several times
    usual : whether ``--help`` shows it, or ``--help-all`` alone
    file : whether it may name a file, which is looked for beside the case first
    flags : as the command line writes it; default ``--name``, None for what only a case says
    section : of a case, where its key may stand too, and that key
    choices : of text, where there are but these
    python : whether `determine` takes it; the others are the command's
    key : whether a case may have it
    """

    metavar: str
    help: str
    read: Callable[[Any, str], Any] = read.anything
    many: bool = False
    usual: bool = False
    file: bool = False
    flags: tuple[str, ...] | None = ()
    section: tuple[str, str] | None = None
    choices: tuple[str, ...] = ()
    python: bool = True
    key: bool = True


def said(default: Any, metavar: str, text: str, reader: Callable[[Any, str], Any] = read.anything, **rest: Any) -> Any:
    """A field of `Case` with its option."""
    return field(default=default, metadata={"option": Option(metavar, text, reader, **rest)})


def asked(default: Any, metavar: str, text: str, reader: Callable[[Any, str], Any] = read.anything, **rest: Any) -> Any:
    """The same for an option that the command alone has."""
    return said(default, metavar, text, reader, python=False, **rest)


def keyed(section: str, key: str, reader: Callable[[Any, str], Any] = read.text) -> Any:
    """The same for what only a section of a case says."""
    return asked(None, "", "", reader, flags=None, section=(section, key))


@dataclass(frozen=True, kw_only=True)
class Case:
    """What a user asks of a determination.  A new option is a field more; where `determine` takes it, a word more there."""

    guess: Any = said(
        None, "ORBIT", "Where to begin: elements, a state, or a file; default none: all orbits that fit.", usual=True, file=True
    )
    prior: Any = said(
        None, "FILE", "An orbit of before, with its covariance; what it has used of the measurements is left out.", file=True
    )
    from_: Any = said(None, "DATE", "From when on measurements are new to --prior, where it does not say.", read.instant)
    stations: Any = said(None, "FILE", "Stations: SINEX, TOML, ilrs, mpc; may be repeated.", many=True, usual=True, file=True)
    participant: Any = said(
        None, "NAME=FILE", "Another satellite that took part, by its orbit; FILE alone (SP3) gives all in it; may be repeated.",
        many=True, file=True,
    )  # fmt: skip
    with_: Any = said(
        None,
        "ESTIMATOR",
        "May be repeated, the first is the answer; window:6h, too.  [default: graph]",
        read.estimators,
        many=True,
        usual=True,
    )
    forces: Any = said(
        "default", "FORCES", 'default, none, or "gravity=EGM2008 degree=40 drag=exponential".  [default: default]', usual=True
    )
    output: tuple[str, ...] = asked(
        (), "FILE", "Write .oem, .opm, .ocm, .omm, .tle, .nc, .csv, .json or .toml; may be repeated.", read.texts, many=True,
        usual=True, flags=("-o", "--output"),
    )  # fmt: skip
    report: str | None = asked(
        None, "DIR", "Write report.html into DIR: one page that works offline; DIR may end in .html.", usual=True
    )
    title: str | None = asked(None, "TEXT", "Title of the page.", read.text)
    figures: str | None = asked(None, "DIR", "Write pictures for papers into DIR.", read.text)
    format: str = asked("pdf", "NAMES", "Of the pictures: pdf,svg,png,pgf.  [default: pdf]", read.formats)
    width: str = asked("88mm", "LENGTH", "Of the pictures: 88mm, 3.5in.  [default: 88mm]", read.width)
    json: bool = asked(False, "", "Print one JSON object on stdout, and nothing else there.", read.flag, usual=True)
    estimate: Any = said(
        None, "NAMES", 'Unknowns beside the orbit: "cd/12h cr bias.range.7090/pass=1m clock.BER=1ms dv@DATE".', read.unknowns,
        many=True,
    )  # fmt: skip
    consider: Any = said(None, "NAME=SIGMA", "Constants that are uncertain: cr=0.1.", read.uncertain, many=True)
    manoeuvre: Any = said(
        None, "FILE|TEXT", '"2026-11-03T04:12:00Z dv=0,0.3,0m/s axes=RTN sigma=0.05m/s for=600s", or CSV, OPM, OCM.',
        many=True, file=True,
    )  # fmt: skip
    mass: float | None = said(None, "KG", "Mass of the object.", read.measure("kg", 0.0), section=("object", "mass"))
    area: float | None = said(None, "M2", "Cross section of the object.", read.measure("m**2", 0.0), section=("object", "area"))
    com: float | None = said(None, "M", "From reflectors to the centre of mass.", read.measure("m"))
    epoch: Any = said(None, "DATE", "Where the answer stands.  [default: the last measurement used]", read.instant)
    span: Any = asked(None, "'A .. B'", 'Of products, as "first .. last+3d".', read.span)
    step: float | None = asked(
        None,
        "TIME",
        "Between states of products.  [default: 60s, about the Sun a day]",
        read.duration,
        section=("product", "step"),
    )
    hold: Any = said(
        None, "ROWS", "Rows to predict without them: last, passes (each in turn), a share such as 1/4, or none.  "
        "[default: passes, where there are 3 to 60]", read.hold,
    )  # fmt: skip
    covariance: str = asked(
        "scaled", "KIND", "Covariances that the verdict calls too small: scaled, as the file says then, or formal.  "
        "[default: scaled]", choices=("scaled", "formal"),
    )  # fmt: skip
    about: str | None = said(
        None, "CENTRE", "What it goes about: earth or sun.  [default: what the measurements fit]", choices=("earth", "sun")
    )
    object: str | None = said(None, "NAME", "Which object, in files of several.", section=("object", "name"))
    each: bool = asked(False, "", "Every object, one after the other; products by {object}.", read.flag)
    against: Any = asked(None, "FILE", "Compare with another orbit, at its rows within the span.", file=True)
    strict: bool = asked(False, "", "Exit 3 where any sentence of the verdict is false.", read.flag)
    anyway: bool = asked(False, "", "Write products of an orbit that is not determined too.", read.flag)
    follow: bool = asked(
        False, "", "Take the last TRACKING row by row as it is written, - for standard input; with ekf, window:6h, ...",
        read.flag,
    )  # fmt: skip
    show: bool = asked(False, "", "Show forces, unknowns, noise and assumptions, and stop.", read.flag)
    save: str | None = asked(None, "CASE", "Write a case (.toml) with all that was assumed filled in.", key=False)
    identifier: str | None = keyed("object", "id")
    norad: int | None = keyed("object", "norad", read.catalogue)
    antenna: tuple[float, float, float] | None = keyed("object", "antenna", read.vector)
    originator: str | None = keyed("product", "originator")
    axes: str | None = keyed("product", "frame", read.axes)
    covariance_step: float | None = keyed("product", "covariance_step", read.duration)
    interpolation: tuple[str, int] | None = keyed("product", "interpolation", read.interpolation)
    answers: Mapping[str, Any] = field(default_factory=dict)  # by the names of ANSWERS
    published: tuple[Published, ...] = ()  # orbits of others, which a result stands beside

    __repr__ = brief

    @classmethod
    def of(cls, words: Mapping[str, Any], where: str = "{}") -> Case:
        """The case of words; see `told`."""
        return cls().told(words, where)

    def told(self, words: Mapping[str, Any], where: str = "{}") -> Case:
        """The same with further words, which override what was said before; None and () say nothing.

        Parameters
        ----------
        words : values by the name of an option or answer
        where : how messages call one: "--{}" on the command line

        Raises
        ------
        ValueError
            For a name that is none, with the nearest, or a value that cannot be.
        """
        found: dict[str, Any] = {}
        answers = dict(self.answers)
        for word, value in words.items():
            name = _python(word)
            if name not in OPTIONS and name not in ANSWERS:
                raise ValueError(f"unknown option {where.format(_key(word))}{nearest(_key(word)[:60], _names())}")
            if value is None or (isinstance(value, tuple | list) and not value):
                continue
            if name in ANSWERS:
                answers[name] = read.duration(value, where.format(_key(word))) if name == "interval" else value
            else:
                found[name] = _read(OPTIONS[name], value, where.format(_key(word)))
        return replace(self, answers=answers, **found)

    @property
    def frame(self) -> str | None:
        """Axes that were said, of the answer and of fixes without any."""
        found = self.answers.get("frame")
        return None if found is None else str(found)


OPTIONS: Mapping[str, Option] = {f.name: f.metadata["option"] for f in fields(Case) if "option" in f.metadata}


def _read(option: Option, value: Any, where: str) -> Any:
    if option.choices and value not in option.choices:
        raise ValueError(f"{where} is {one_line(str(value), 60)!r}{nearest(str(value)[:60], option.choices)}")
    return option.read(value, where)


def _names() -> list[str]:
    return [_key(name) for name in dict.fromkeys([*OPTIONS, *ANSWERS])]


def _key(name: str) -> str:
    """The name as users write it: that of Python has an underscore where it would be a keyword."""
    return one_line(name.rstrip("_"), 60)


def _python(key: str) -> str:
    name = key.replace("-", "_")
    return f"{name}_" if f"{name}_" in OPTIONS else name
