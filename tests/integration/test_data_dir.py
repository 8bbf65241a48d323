"""Reasons why a daemon does not start: files that others could change, missing keys, a folder in use."""
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

from harness import BIN, Daemon, DaemonTest

NOBODY = 65534


class DataDir(DaemonTest):
    device = "cpu"

    def setUp(self):
        self.data = tempfile.mkdtemp(prefix="voxeld-data-")
        self.addCleanup(shutil.rmtree, self.data, ignore_errors=True)
        self.addCleanup(pathlib.Path(self.data + ".log").unlink, missing_ok=True)

    def run_daemon(self, *arguments):
        daemon = Daemon(device="cpu", arguments=arguments, data_dir=self.data)
        self.addCleanup(daemon.stop)
        return daemon

    def add_key(self, *arguments):
        return subprocess.run([BIN / "voxeld", "keys", "add", "lab", "--data", self.data, *arguments],
                              capture_output=True, text=True)

    def refused(self, *parts):
        process = subprocess.Popen(
            [BIN / "voxeld", "serve", "--listen", "127.0.0.1:0", "--admin-listen", "127.0.0.1:0", "--data",
             self.data, "--device", "cpu"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        line = process.stdout.readline()  # of one that starts
        if line:
            process.terminate()
        _, text = process.communicate(timeout=60)
        self.assertEqual((line, process.returncode), ("", 1), text)
        for part in parts:
            self.assertIn(part, text.splitlines()[-1])

    def test_a_file(self):
        os.rmdir(self.data)
        pathlib.Path(self.data).touch()
        self.addCleanup(pathlib.Path(self.data).unlink)
        self.refused(f"the data directory: expected a directory, got {self.data}")

    def test_a_folder_where_others_may_put_files(self):
        os.chmod(self.data, 0o777)
        self.refused(self.data + " is open to other users", f"chmod go-w {self.data}",
                     "expected no write permission for group and others, got mode 0777")
        os.chmod(self.data, 0o755)
        self.run_daemon()

    def test_a_folder_of_another_user(self):
        if os.geteuid() != 0:
            self.skipTest("only root can give a folder away")
        os.chown(self.data, NOBODY, NOBODY)
        self.refused(self.data + " belongs to another user", f"chown 0 {self.data}",
                     "expected uid 0, got uid 65534")

    def test_keys_that_another_user_put_there(self):
        """In a folder that was open to all for a while."""
        if os.geteuid() != 0:
            self.skipTest("only root can give a file away")
        self.add_key("--admin")
        os.chown(self.data + "/keys", NOBODY, NOBODY)
        self.refused(self.data + "/keys belongs to another user", "expected uid 0, got uid 65534")

    def test_secrets_that_others_may_read(self):
        self.add_key()
        self.run_daemon().stop()
        for name, mode, text in (("keys", 0o640, "mode 0640"), ("url_secret", 0o604, "mode 0604")):
            os.chmod(f"{self.data}/{name}", mode)
            self.refused(f"{self.data}/{name} is open to other users", f"chmod go-rwx {self.data}/{name}",
                         "expected no permission for group and others, got " + text)
            os.chmod(f"{self.data}/{name}", 0o600)
        self.run_daemon()

    def test_keys_that_are_gone(self):
        self.add_key()
        daemon = self.run_daemon()
        self.assertEqual(daemon.get("/v1/jobs").status, 401)
        daemon.stop()
        os.unlink(self.data + "/keys")
        self.refused("the API keys of this store are gone", "voxeld keys add", "--forget-keys")
        key = self.add_key().stdout.strip()
        daemon.start()
        self.assertEqual(daemon.holding(key).get("/v1/jobs").status, 200)
        daemon.stop()
        os.unlink(self.data + "/keys")
        daemon.arguments = ["--forget-keys"]
        daemon.start()
        self.assertEqual(daemon.get("/v1/jobs").status, 200)
        daemon.stop()
        daemon.arguments = []
        daemon.start()  # it is forgotten for good

    def test_a_second_daemon_though_the_lock_file_was_removed(self):
        daemon = self.run_daemon()
        self.refused(f"{self.data} is in use by process {daemon.process.pid}",
                     "expected one daemon for each data directory")
        os.unlink(self.data + "/lock")
        self.refused(f"{self.data} is in use by another process")
        self.assertEqual(daemon.get("/v1/jobs").status, 200)


if __name__ == "__main__":
    unittest.main()
