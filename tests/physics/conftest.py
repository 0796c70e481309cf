import sys
from pathlib import Path

import pytest

# Test modules import the helpers `beams` and `fem` beside them by name.
sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(params=["f32", "f64"])
def precision(request):
    return request.param
