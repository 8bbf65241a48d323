"""--connections-per-address: in a network of the test's own, whose loopback has foreign addresses."""
import ctypes
import errno
import fcntl
import http.client
import os
import socket
import struct
import subprocess
import unittest

from harness import HANG_SECONDS, Daemon, wait_until

CLONE_NEWUSER, CLONE_NEWNET = 0x10000000, 0x40000000
SIOCSIFADDR, SIOCSIFFLAGS, IFF_UP = 0x8916, 0x8914, 1
CAP = 3
GREEDY, OTHER = "192.0.2.1", "192.0.2.2"  # of those that documentation may use
SERVER_6 = "2001:db8::1"
GREEDY_6 = ("2001:db8:0:1::1", "2001:db8:0:1:ffff::2", "2001:db8:0:1:0:1::3", "2001:db8:0:1::4")  # one customer's
OTHER_6 = "2001:db8:0:2::1"


def enter_network():
    """False where the system does not let this process have a network of its own, or configure it."""
    libc = ctypes.CDLL(None, use_errno=True)
    for flags in (CLONE_NEWNET, CLONE_NEWUSER | CLONE_NEWNET):
        if libc.unshare(flags) == 0:
            break
    else:
        if ctypes.get_errno() in (errno.EPERM, errno.ENOSPC, errno.EINVAL):
            return False
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
        try:
            fcntl.ioctl(control, SIOCSIFFLAGS, struct.pack("16sH14x", b"lo", IFF_UP))
        except PermissionError:
            return False
        for i, address in enumerate((GREEDY, OTHER)):
            fcntl.ioctl(control, SIOCSIFADDR, struct.pack(
                "16sHH4s8x", f"lo:{i + 1}".encode(), socket.AF_INET, 0, socket.inet_aton(address)))
    return True


def enter_network_6():
    """Why this network has no IPv6, or "" where it has."""
    for address in (SERVER_6, *GREEDY_6, OTHER_6):
        done = subprocess.run(["ip", "-6", "address", "add", f"{address}/128", "dev", "lo", "nodad"],
                              capture_output=True, text=True)
        if done.returncode != 0:
            return done.stderr.strip() or f"ip: exit status {done.returncode}"
    return ""


class ConnectionCap(unittest.TestCase):
    def connect(self, source, to=None):
        connection = http.client.HTTPConnection(to or source, self.daemon.port, timeout=HANG_SECONDS,
                                                source_address=(source, 0))
        self.addCleanup(connection.close)
        connection.connect()
        return connection

    def ask(self, connection):
        """The status, or None where the connection was closed."""
        try:
            connection.request("GET", "/")
            response = connection.getresponse()
            response.read()
            return response.status
        except (http.client.RemoteDisconnected, ConnectionResetError, BrokenPipeError):
            connection.close()
            return None

    def test_one_address_gets_so_many_connections_and_others_are_served(self):
        self.daemon = Daemon(device="cpu", listen="0.0.0.0:0", arguments=(
            "--allow-remote", "--connections-per-address", str(CAP)))
        self.addCleanup(self.daemon.stop)
        held = [self.connect(GREEDY) for _ in range(CAP)]
        self.assertEqual([self.ask(one) for one in held], [200] * CAP)
        self.assertIsNone(self.ask(self.connect(GREEDY)), "one more is closed")
        self.assertEqual(self.ask(self.connect(OTHER)), 200)
        # Loopback has no cap: proxies of the same machine speak for many.
        for source in ("127.0.0.1", "127.0.0.2"):
            self.assertEqual([self.ask(self.connect(source)) for _ in range(2 * CAP)], [200] * 2 * CAP)
        self.assertEqual([self.ask(one) for one in held], [200] * CAP, "those that were there stay")
        held[0].close()
        wait_until(lambda: self.ask(self.connect(GREEDY)) == 200, "a connection in the place of a closed one")

    def test_a_customer_with_2_to_the_64_addresses_is_one(self):
        if missing := enter_network_6():
            self.skipTest(f"no IPv6 here: {missing}")
        self.daemon = Daemon(device="cpu", listen="[::]:0", arguments=(
            "--allow-remote", "--connections-per-address", str(CAP)))
        self.addCleanup(self.daemon.stop)
        held = [self.connect(source, SERVER_6) for source in GREEDY_6[:CAP]]
        self.assertEqual([self.ask(one) for one in held], [200] * CAP)
        self.assertIsNone(self.ask(self.connect(GREEDY_6[CAP], SERVER_6)), "one more is closed")
        self.assertEqual(self.ask(self.connect(OTHER_6, SERVER_6)), 200)
        # IPv4 comes by the same listener, and its addresses count each for itself.
        held_4 = [self.connect(GREEDY) for _ in range(CAP)]
        self.assertEqual([self.ask(one) for one in held_4], [200] * CAP)
        self.assertIsNone(self.ask(self.connect(GREEDY)))
        self.assertEqual(self.ask(self.connect(OTHER)), 200)
        self.assertEqual([self.ask(self.connect("127.0.0.1")) for _ in range(2 * CAP)], [200] * 2 * CAP)


def setUpModule():
    if not enter_network():
        raise unittest.SkipTest("this user can have no network of its own")


if __name__ == "__main__":
    unittest.main()
