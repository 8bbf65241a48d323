"""The Python package of this tree, with the decoder of this build: import this before `voxeld`."""
import os
import sys

from harness import BIN, ROOT

PACKAGE = ROOT / "python"
LIBRARY = BIN.resolve().parent / "lib/libvoxeld_client.so.0"
ENVIRONMENT = {"PYTHONPATH": str(PACKAGE), "PYTHONDONTWRITEBYTECODE": "1", "VOXELD_CLIENT_LIBRARY": str(LIBRARY)}

sys.path.insert(0, str(PACKAGE))
os.environ["VOXELD_CLIENT_LIBRARY"] = ENVIRONMENT["VOXELD_CLIENT_LIBRARY"]
