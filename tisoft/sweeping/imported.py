"""What workers import before they are begun, once for all of them; see cluster.prepare."""

import distributed.nanny
import distributed.worker  # noqa: F401

from tisoft import runtime
from tisoft.errors import SceneError

try:
    runtime.import_taichi()
    import tisoft.check.limiting
    import tisoft.check.warnings
    import tisoft.observers.summary
    import tisoft.simulation  # noqa: F401
except SceneError:  # each row says what is missing
    pass
