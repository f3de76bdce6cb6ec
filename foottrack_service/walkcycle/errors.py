"""What can be wrong with a walk. Every message names the place.

::

    WalkError(ValueError)
    +-- ProjectError      a project file: JSON, schema, poses
    +-- PathError         a path: its text, its file, its length
    +-- ReachError        a foot further away than the leg is long
    +-- MotionFileError   a BVH or GLB file that cannot be read back
"""

from __future__ import annotations


class WalkError(ValueError):
    """Something about a walk is wrong; the message says what and where."""


class ProjectError(WalkError):
    """A project that cannot be read, or whose poses make no cycle."""


class PathError(WalkError):
    """A path that cannot be read, or that is too short to walk on."""


class ReachError(WalkError):
    """A foot target beyond the leg's reach."""


class MotionFileError(WalkError):
    """A motion file that cannot be read back."""
