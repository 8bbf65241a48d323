"""Tenants that contend for one device: what test_fairness asserts and tests/bench/fairness.py measures."""
import time

from harness import TenantsDaemon, wait_until

# Long on any machine, in many tiles, each of a few milliseconds; cancelled when it is not needed any more.
GIANT = {"size": 16384, "channels": "occupancy", "cache": "no"}
# Takes longer. Between two of its jobs a tenant does not want the device for a moment, and the others
# have it.
LONG = {**GIANT, "channels": "occupancy,normal"}
SMALL = {"size": 48, "cache": "no"}


class Contention(TenantsDaemon):
    """Each tenant has the same mesh."""

    def __init__(self, weights, device="cpu", arguments=()):
        super().__init__(weights, device=device, arguments=arguments)
        self.assets = {name: tenant.upload(self.fixtures / "sample.ply")
                       for name, tenant in self.tenants.items()}

    def submit(self, tenant, options, **job):
        return self.tenants[tenant].submit(kind="voxelize", asset=self.assets[tenant],
                                           options=options, **job)

    def submit_endless(self, tenant, **job):
        """A giant job that outlasts a test on any machine."""
        asset = self.tenants[tenant].upload(self.fixtures / "sheets.obj")
        return self.tenants[tenant].submit(kind="voxelize", asset=asset, options=GIANT, **job)

    def status(self, tenant, job):
        return self.tenants[tenant].get(f"/v1/jobs/{job}").json()

    def cancel(self, tenant, job):
        self.tenants[tenant].request("DELETE", f"/v1/jobs/{job}")

    def wait_for_device(self, tenant, job):
        """Until the job has had a time slice."""
        wait_until(lambda: self.status(tenant, job)["device_ms"] > 0, lambda: self.status(tenant, job))


def giants_for(seconds):
    """How many of them last for longer than that, also where one has the device to itself."""
    return 2 + int(seconds / 4)


def shares(weights, seconds, giant=GIANT, device="cpu", arguments=()):
    """Milliseconds of the device that each tenant's giant jobs had while all of them wanted it."""
    with Contention(weights, device, arguments) as load:
        # Each tenant's first job before any second one: none has two workers that it would have to give up.
        jobs = {name: [load.submit(name, giant)] for name in weights}
        for name, own in jobs.items():
            load.wait_for_device(name, own[0])
            own += [load.submit(name, giant) for _ in range(giants_for(seconds) - 1)]

        def device_ms():
            return {name: sum(load.status(name, job)["device_ms"] for job in own)
                    for name, own in jobs.items()}

        before = device_ms()
        time.sleep(seconds)
        after = device_ms()
        for name, own in jobs.items():
            last = load.status(name, own[-1])
            assert last["state"] in ("queued", "running"), last  # else there was no contention
            for job in own:
                load.cancel(name, job)
        return {name: after[name] - before[name] for name in weights}


def many_tenants(weights, seconds, giant, small_every_s=0.5, device="cpu", arguments=()):
    """More tenants than workers, each with giant jobs: milliseconds of the device that each had, how
    often its jobs were preempted, and the seconds from acceptance to the end of small jobs that one more
    tenant submits meanwhile."""
    with Contention({**weights, "small": 1}, device, arguments) as load:
        jobs = {name: [load.submit(name, {**giant, "padding": i}) for i in range(giants_for(seconds))]
                for name in weights}
        for name, own in jobs.items():
            load.wait_for_device(name, own[0])

        def total(member):
            return {name: sum(load.status(name, job)[member] for job in own)
                    for name, own in jobs.items()}

        before = total("device_ms")
        begin = time.monotonic()
        ended = []
        while time.monotonic() < begin + seconds:
            time.sleep(small_every_s)
            status = load.tenants["small"].wait(load.submit("small", SMALL), 3600)
            assert status["state"] == "done", status
            ended.append((status["ended_ms"] - status["created_ms"]) / 1000)
        after, preempted = total("device_ms"), total("preempted")
        for name, own in jobs.items():
            last = load.status(name, own[-1])
            assert last["state"] in ("queued", "running"), last  # else there was no contention
            for job in own:
                load.cancel(name, job)
        return {name: after[name] - before[name] for name in weights}, preempted, sorted(ended)


def waits(scheduler, seconds, giant, small_every_s=0.25, device="cpu", arguments=()):
    """Seconds from acceptance to the end of small jobs of one tenant while another has three giant
    ones, and until those had ended."""
    arguments = ["--scheduler", scheduler, *arguments]
    with Contention({"giants": 1, "small": 1}, device, arguments) as load:
        giants = [load.submit("giants", {**giant, "padding": i}) for i in range(3)]
        load.wait_for_device("giants", giants[0])
        begin = time.monotonic()
        small = []
        while time.monotonic() < begin + seconds:
            small.append(load.submit("small", {**SMALL, "padding": len(small) % 8}))
            time.sleep(max(0.0, begin + len(small) * small_every_s - time.monotonic()))
        ended = []
        for job in small:
            status = load.tenants["small"].wait(job, 3600)
            assert status["state"] == "done", status
            ended.append((status["ended_ms"] - status["created_ms"]) / 1000)
        last = [load.tenants["giants"].wait(job, 3600) for job in giants]
        assert all(status["state"] == "done" for status in last), last
        took = max(status["ended_ms"] for status in last) - min(s["created_ms"] for s in last)
        return sorted(ended), took / 1000


def percentile(ordered, share):
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]
