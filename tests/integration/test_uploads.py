"""Large uploads stream to disk."""
import http.client
import unittest

from harness import DaemonTest

MEGABYTE = 1 << 20


class Uploads(DaemonTest):
    def resident_kib(self, pid):
        with open(f"/proc/{pid}/status") as file:
            return next(int(line.split()[1]) for line in file if line.startswith("VmHWM"))

    def upload(self, megabytes, chunked):
        connection = http.client.HTTPConnection("127.0.0.1", self.daemon.port, timeout=300)

        def parts():
            for i in range(megabytes):
                yield (b"# comment %d\n" % i).ljust(MEGABYTE, b"#")[:-1] + b"\n"

        headers = {"Content-Type": "model/obj"}
        if not chunked:
            headers["Content-Length"] = str(megabytes * MEGABYTE)
        connection.request("POST", "/v1/assets?filename=big.obj", body=parts(), headers=headers,
                           encode_chunked=chunked)
        response = connection.getresponse()
        response.read()
        connection.close()
        return response.status

    def test_200_megabytes_do_not_sit_in_memory(self):
        before = self.resident_kib(self.daemon.process.pid)
        self.assertEqual(self.upload(200, chunked=False), 201)
        self.assertEqual(self.upload(200, chunked=True), 200)  # the same bytes
        grown = self.resident_kib(self.daemon.process.pid) - before
        self.assertLess(grown, 64 * 1024, f"the gateway grew by {grown} KiB")


if __name__ == "__main__":
    unittest.main()
