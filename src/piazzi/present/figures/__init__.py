"""Pictures.  Every function takes matplotlib Axes, draws on them and returns them; `pages` puts them together."""

from piazzi.present.figures.errors import claim_overlay, error_overlay, nees_track, nis_track, state_error
from piazzi.present.figures.measured import innovations, measurements, passes, residuals
from piazzi.present.figures.sight import bound_sigmas, singular_values
from piazzi.present.figures.space import orbit, path_beside_truth, position_at
from piazzi.present.figures.trade import timing, window_consistency, window_cost, window_trade

__all__ = [
    "bound_sigmas", "claim_overlay", "error_overlay", "innovations", "measurements", "nees_track", "nis_track", "orbit",
    "passes", "path_beside_truth", "position_at", "residuals", "singular_values", "state_error", "timing", "window_consistency",
    "window_cost", "window_trade",
]  # fmt: skip
