"""``piazzi cite``: what a paper should name."""

from __future__ import annotations

import click

from piazzi.cli import output
from piazzi.cli.running import DONE

# Of others, what their use asks a paper to name: when it applies, and the entry
SOURCES = {
    "the gravity field EGM2008": """@article{egm2008,
  author  = {Pavlis, Nikolaos K. and Holmes, Simon A. and Kenyon, Steve C. and Factor, John K.},
  title   = {The development and evaluation of the {Earth Gravitational Model} 2008 ({EGM2008})},
  journal = {Journal of Geophysical Research: Solid Earth},
  volume  = {117}, number = {B4}, pages = {B04406}, year = {2012}, doi = {10.1029/2011JB008916},
}""",
    "axes, tides and the orientation of the Earth": """@book{iers2010,
  editor    = {Petit, G{\\'e}rard and Luzum, Brian},
  title     = {{IERS} Conventions (2010)},
  series    = {{IERS} Technical Note}, number = {36}, year = {2010},
  publisher = {Verlag des Bundesamts f{\\"u}r Kartographie und Geod{\\"a}sie},
  address   = {Frankfurt am Main}, issn = {1019-4568},
}""",
    "laser ranges, stations and satellites of the ILRS": """@article{ilrs,
  author  = {Pearlman, Michael R. and Noll, Carey E. and Pavlis, Erricos C. and others},
  title   = {The {ILRS}: approaching 20 years and planning for the future},
  journal = {Journal of Geodesy}, volume = {93}, pages = {2161--2180}, year = {2019}, doi = {10.1007/s00190-019-01241-1},
}""",
    "sigmas of asteroid astrometry where files have none": """@article{veres2017,
  author  = {Vere{\\v{s}}, Peter and Farnocchia, Davide and Chesley, Steven R. and Chamberlin, Alan B.},
  title   = {Statistical analysis of astrometric errors for the most productive asteroid surveys},
  journal = {Icarus}, volume = {296}, pages = {139--149}, year = {2017}, doi = {10.1016/j.icarus.2017.05.021},
}""",
    "biases of star catalogues taken off (--debias)": """@article{eggl2020,
  author  = {Eggl, S. and Farnocchia, D. and Chamberlin, A. B. and Chesley, S. R.},
  title   = {Star catalog position and proper motion corrections in asteroid astrometry {II}: The {Gaia} era},
  journal = {Icarus}, volume = {339}, pages = {113596}, year = {2020}, doi = {10.1016/j.icarus.2019.113596},
}""",
}


@click.command()
def command() -> int:
    """Print what a paper should name, as BibTeX.

    Piazzi itself first; then the models and services that determinations rest on, each after a comment that says when.

    Examples:
      piazzi cite >> paper.bib
    """
    output.print_text("\n\n".join([own(), *(f"% for {when}\n{entry}" for when, entry in SOURCES.items())]))
    return DONE


def own() -> str:
    """The entry of this package."""
    from piazzi import __version__

    return f"""@software{{piazzi,
  author  = {{{{Piazzi contributors}}}},
  title   = {{Piazzi: orbit and state estimation, estimators side by side}},
  version = {{{__version__}}},
}}"""
