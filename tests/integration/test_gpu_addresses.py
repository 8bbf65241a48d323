"""GPUs by PCI address: three that libglvnd finds in another order (fake_gpus), played by Mesa's software driver."""
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

from harness import BIN

LIBRARY = BIN.parent / "lib" / "libfake_gpus.so"
FIRST, SECOND = "0000:3b:00.0", "0000:af:00.0"


class ByAddress(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="voxeld-gpus-")
        cls.addClassCleanup(folder.cleanup)
        vendor = pathlib.Path(folder.name) / "vendor.json"
        vendor.write_text(json.dumps({"file_format_version": "1.0.0", "ICD": {"library_path": str(LIBRARY)}}))
        cls.environment = {**os.environ, "__EGL_VENDOR_LIBRARY_FILENAMES": str(vendor), "LD_PRELOAD": str(LIBRARY),
                           "force_gl_renderer": "FakeGPU"}

    def probe(self, device):
        done = subprocess.run([BIN / "voxeld", "probe-device", "--device", device, "--sandbox", "off"],
                              env=self.environment, capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, 0, done)
        return json.loads(done.stdout.strip().splitlines()[-1])

    def test_numbers_follow_the_addresses_and_those_without_come_last(self):
        found = [self.probe(f"egl:{number}") for number in range(3)]
        self.assertEqual([each["info"]["pci_address"] for each in found], [FIRST, SECOND, ""])

    def test_an_address_names_its_gpu_in_every_form(self):
        for name, address in ((f"pci:{FIRST}", FIRST), ("pci:af:00.0", SECOND), ("pci:00000000:AF:00.0", SECOND)):
            with self.subTest(name):
                found = self.probe(name)
                self.assertEqual(found["device"], f"pci:{address}")
                self.assertTrue(found["works"], found)
                self.assertEqual(found["info"]["pci_address"], address)
                self.assertEqual(found["info"]["renderer"], "FakeGPU")

    def test_an_address_without_a_gpu_lists_those_that_have_one(self):
        found = self.probe("pci:0000:01:00.0")
        self.assertEqual(found["reason"], "pci:0000:01:00.0 does not exist: expected "
                         f"egl:0 (pci:{FIRST}), egl:1 (pci:{SECOND}), egl:2, got 3 devices")

    def test_doctor_prints_the_addresses(self):
        done = subprocess.run([BIN / "voxeld", "doctor", "--sandbox", "off"], env=self.environment,
                              capture_output=True, text=True, timeout=300)
        self.assertRegex(done.stdout, rf"egl:0 +FakeGPU\n(.+\n)*? +address pci:{FIRST}\n")
        self.assertRegex(done.stdout, rf"egl:1 +FakeGPU\n(.+\n)*? +address pci:{SECOND}\n")
        self.assertNotIn("address pci:\n", done.stdout)


if __name__ == "__main__":
    unittest.main()
