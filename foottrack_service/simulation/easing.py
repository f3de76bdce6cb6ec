"""From rest to rest: shares of a motion over time, with two continuous derivatives."""

from __future__ import annotations

import numpy as np

from foottrack_service.rotations import Array


def ease(share: Array) -> Array:
    """0 before share 0, 1 after share 1, minimum jerk in between (Flash and Hogan 1985); (n,)."""
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


def there_and_back(t: Array, start: float, end: float) -> Array:
    """0 to 1 and back to 0 between two instants, with a rest at the top; (n,)."""
    rise = 0.4 * (end - start)
    return ease((t - start) / rise) - ease((t - end + rise) / rise)
