"""Which kernel fragments a problem needs: estimators ask for a part, the problem's settings decide which one it is."""

from __future__ import annotations

from piazzi.kernels import Integrator


def composed(
    fragments: tuple[str, ...], integrator: Integrator, *, manoeuvres: bool, axes: str, noise_varies: bool, in_lanes: bool
) -> tuple[str, ...]:
    """The fragments by the names of their files, in order; `axes` of the process noise, `in_lanes` if states move together.

    "transition" becomes the motion of the integrator and the events on the way; "noise_scaled" and "noise_integral" become the
    axes of the noise, its integration and the same events; "linearize_scaled" is replaced where states cannot be worked on
    together; that and "chain_noise_scaled" where the noise is not a multiple of one matrix.
    """
    events = "_manoeuvres" if manoeuvres else ""
    turned = "axes_orbit" if axes == "orbit" else "axes"
    linearize = "linearize_integral" if noise_varies else "linearize_scaled" if in_lanes else "linearize_each"
    parts = {
        "transition": ("matrices", *integrator.fragments, f"transition{events}"),
        "noise_scaled": (turned, "noise_scaled", f"advance{events}"),
        "noise_integral": (turned, *integrator.noise_fragments, f"advance{events}"),
        "linearize_scaled": (linearize,),
        "chain_noise_scaled": (f"chain_noise_{'integral' if noise_varies else 'scaled'}",),
    }
    return tuple(part for name in fragments for part in parts.get(name, (name,)))
