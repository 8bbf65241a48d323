"""Runs every command block of docs/*.md and docker/README.md as a reader would."""
import unittest

import test_docs
from harness import ROOT


class Pages(test_docs.PagesTest):
    pass


def add_page(page):
    name = str(page.relative_to(ROOT).with_suffix("")).replace("/", "_").lower()
    setattr(Pages, f"test_{name}", lambda self: self.run_page(page))


for one_page in (*sorted((ROOT / "docs").glob("*.md")), ROOT / "docker/README.md"):
    add_page(one_page)


if __name__ == "__main__":
    unittest.main()
