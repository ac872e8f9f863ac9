"""Pictures.  Every function takes matplotlib Axes, draws on them and returns them; `pages` puts them together."""

from piazzi.present.figures.errors import claim_overlay, error_overlay, state_error
from piazzi.present.figures.measured import innovations, measurements
from piazzi.present.figures.space import orbit, position_at

__all__ = ["claim_overlay", "error_overlay", "innovations", "measurements", "orbit", "position_at", "state_error"]
