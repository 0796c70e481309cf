import sys
from pathlib import Path

# Test modules import the helper `static_cases` beside them by name.
sys.path.insert(0, str(Path(__file__).parent))
