"""What can go wrong, as sentences for the user and exit codes for the shell."""


class TisoftError(Exception):
    """Base of all errors that tisoft raises on purpose; the text is one clear sentence."""

    exit_code = 2


class SceneError(TisoftError):
    """A scene, argument, file or device that the user can mend."""


class MeshError(SceneError):
    """A mesh, or a mesh file, that cannot be simulated."""


class Diverged(TisoftError):
    """The simulation failed: positions stopped being finite, past recovery."""

    exit_code = 3


class OutOfTime(TisoftError):
    """An answer was wanted by a time that has passed."""


class NoEquilibrium(TisoftError):
    """No static equilibrium was found on the branch followed from rest."""

    exit_code = 4
    load_factor: float = 0.0
    """Share of the load that still had an equilibrium."""
