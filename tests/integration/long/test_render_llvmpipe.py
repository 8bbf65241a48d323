"""The images of test_render on a daemon with a GL context."""
import unittest

import test_render


class Render(test_render.Render):
    device = "llvmpipe"


if __name__ == "__main__":
    unittest.main()
