"""A comparison of voxels for the tests of the documentation's readers."""
import numpy as np


class SameRows:
    def assert_same_rows(self, got, expected):
        """The same rows in whatever order; tells the first that differs (the list is too long)."""
        self.assertEqual(got.shape, expected.shape)
        got, expected = (rows[np.lexsort(rows.T[::-1])] for rows in (got, expected))
        different = np.nonzero((got != expected).any(1))[0]
        if len(different):
            row = different[0]
            self.fail(f"{len(different)} rows differ, first {got[row]}, expected {expected[row]}")
