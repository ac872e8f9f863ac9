"""Which kernel fragments a problem needs: estimators ask for a part, the problem's settings decide which one it is."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from piazzi.problem.problem import Problem


def composed(problem: Problem, fragments: tuple[str, ...], lanes: int) -> tuple[str, ...]:
    """The fragments by the names of their files, in order.

    "transition" becomes the motion of the integrator and the events on the way; "noise_scaled" and "noise_integral" become the
    axes of the noise, its integration and the same events; "linearize_scaled" is replaced where states cannot be worked on
    together; that and "chain_noise_scaled" where the noise is not a multiple of one matrix.
    """
    integrator = problem.integrator
    assert integrator is not None
    events = "_manoeuvres" if problem.manoeuvres else ""
    axes = "axes_orbit" if problem.process_noise.axes == "orbit" else "axes"
    together = problem.moves_in_lanes and lanes > 1
    linearize = "linearize_integral" if problem.noise_varies else "linearize_scaled" if together else "linearize_each"
    parts = {
        "transition": ("matrices", *integrator.fragments, f"transition{events}"),
        "noise_scaled": (axes, "noise_scaled", f"advance{events}"),
        "noise_integral": (axes, *integrator.noise_fragments, f"advance{events}"),
        "linearize_scaled": (linearize,),
        "chain_noise_scaled": (f"chain_noise_{'integral' if problem.noise_varies else 'scaled'}",),
    }
    return tuple(part for name in fragments for part in parts.get(name, (name,)))
