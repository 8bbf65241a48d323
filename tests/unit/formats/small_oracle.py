"""Another reader of codec small, written from proto/README.md with plain loops: the oracle of the C++
one. Slow: some thousand voxels a second.

    read_tile(streams)   streams: {"octree": bytes of a tile, "color": …} with the channels it has
        -> {(x, y, z): {"color": samples, …}}, {} for voxels of full nodes
"""
import math

ANCHORS = [round(65536 / (1 + math.exp(-i / 2))) for i in range(-24, 25)]


def squash(x):
    x = max(-3071, min(3071, x)) + 24 * 128
    low, high = ANCHORS[x // 128], ANCHORS[x // 128 + 1]
    return low + (high - low) * (x % 128) // 128


def make_stretch():
    table, x = [], -3071
    for i in range(4096):
        while squash(x) < 16 * i + 8:
            x += 1
        table.append(x)
    return table


STRETCH = make_stretch()


class Reader:
    def __init__(self, data):
        self.data, self.at = data, 4
        self.range, self.code = 0xffffffff, int.from_bytes(data[:4], "big")

    def bit(self, p):
        bound = self.range * p >> 16
        bit = self.code < bound
        if bit:
            self.range = bound
        else:
            self.code -= bound
            self.range -= bound
        while self.range < 1 << 24:
            self.range <<= 8
            self.code = (self.code << 8 | self.data[self.at]) & 0xffffffff
            self.at += 1
        return int(bit)

    def close(self):
        assert self.at == len(self.data), (self.at, len(self.data))


class Adaptive:
    __slots__ = ("q", "n")

    def __init__(self, q=1 << 23, n=0):
        self.q, self.n = q, n

    def learn(self, bit):
        goal = (1 << 24) - 1 if bit else 0
        self.q += (goal - self.q) * (655360 // (10 * self.n + 16)) >> 16
        self.n = min(self.n + 1, 255)


class Model:
    BITS = (15, 15, 13, 16, 17)

    def __init__(self, other=None):
        if other:
            self.tables = [{key: Adaptive(e.q, e.n) for key, e in t.items()} for t in other.tables]
            self.weights = {key: [row[:] for row in rows] for key, rows in other.weights.items()}
        else:
            self.tables, self.weights = [{} for _ in range(5)], {}

    @staticmethod
    def hash(v):
        v = v * 0x9e3779b1 & 0xffffffff
        v ^= v >> 15
        return v * 0x85ebca6b & 0xffffffff

    def bit(self, reader, values, s):
        weights = self.weights.setdefault(
            s, [[0] + [9830 + 1966 * k for k in range(1, 9)] for _ in range(5)])
        entries = [table.setdefault(self.hash(v) >> (32 - bits), Adaptive())
                   for table, v, bits in zip(self.tables, values, self.BITS)]
        x = [STRETCH[e.q >> 12] for e in entries]
        k = [e.n.bit_length() for e in entries]
        total = sum(weights[i][k[i]] * x[i] for i in range(5)) >> 16
        p = max(1, min(65535, squash(total)))
        bit = reader.bit(p)
        error = (65536 if bit else 0) - p
        for i in range(5):
            w = weights[i][k[i]] + (x[i] * error + (1 << 13) >> 14)
            weights[i][k[i]] = max(-(1 << 19), min(1 << 19, w))
            entries[i].learn(bit)
        return bit


def packed(bits):
    return sum(bit << i for i, bit in enumerate(bits))


def in_order(nodes):
    return sorted(nodes, key=lambda c: c[::-1])


def read_occupied(reader, model, parents, full_parents, side, level):
    """The occupied children of `parents`; those of full ones are told nowhere."""
    cells = {tuple(2 * p + (i >> c & 1) for c, p in enumerate(parent))
             for parent in full_parents for i in range(8)}
    told = {tuple(2 * p + (i >> c & 1) for c, p in enumerate(parent))
            for parent in parents - full_parents for i in range(8)}
    for x, y, z in in_order(told):
        def n(i, j, k):
            return int((x + i, y + j, z + k) in cells)

        def q(i, j, k):
            return int(((x + i) >> 1, (y + j) >> 1, (z + k) >> 1) in parents)

        place = packed([x & 1, y & 1, z & 1])
        touching = [n(-1, 0, 0), *(n(i, -1, 0) for i in (-1, 0, 1)),
                    *(n(i, -1, -1) for i in (-1, 0, 1)), *(n(i, 0, -1) for i in (-1, 0, 1)),
                    *(n(i, 1, -1) for i in (-1, 0, 1))]
        siblings = [(i, j, k) for i in (0, -1) for j in (0, -1) for k in (0, -1)][1:]
        if place == 7 and not any(n(*s) for s in siblings):
            cells.add((x, y, z))
            continue
        far = packed([n(-2, 0, 0), n(-2, -1, 0), n(2, -1, 0), *(n(i, -2, 0) for i in (-1, 0, 1)),
                      n(0, -1, -2), *(n(i, 0, -2) for i in (-1, 0, 1)), n(0, 1, -2)])
        coming = packed([q(1, 0, 0), q(-1, 1, 0), q(1, 1, 0), q(-1, -1, 1), q(1, -1, 1),
                         q(-1, 0, 1), q(1, 0, 1), q(-1, 1, 1), q(1, 1, 1)])
        faces = packed([q(1, 0, 0), q(0, 1, 0), q(0, 0, 1)])
        faces_far = packed([q(2, 0, 0), q(0, 2, 0), q(0, 0, 2)])
        touch = packed(touching)
        values = (place | faces << 3 | (touch & 0x0baf) << 6, place | faces << 3 | touch << 6,
                  place | faces_far << 3 | coming << 6 | n(-1, 0, 0) << 15 | n(0, -1, 0) << 16 |
                  n(0, 0, -1) << 17,
                  place | coming << 3 | touch << 12, place | faces << 3 | touch << 6 | far << 19)
        if model.bit(reader, values, level << 3 | place):
            cells.add((x, y, z))
    return cells


def read_full(reader, occupied, inside_larger):
    full, models = set(inside_larger), [Adaptive() for _ in range(16)]
    for x, y, z in in_order(occupied - inside_larger):
        around = all(c in occupied for c in ((x - 1, y, z), (x + 1, y, z), (x, y - 1, z),
                                             (x, y + 1, z), (x, y, z - 1), (x, y, z + 1)))
        model = models[packed([(x - 1, y, z) in full, (x, y - 1, z) in full,
                               (x, y, z - 1) in full, around])]
        bit = reader.bit(max(1, min(65535, model.q >> 8)))
        model.learn(bit)
        if bit:
            full.add((x, y, z))
    return full


def children(nodes):
    return {tuple(2 * p + (i >> c & 1) for c, p in enumerate(node))
            for node in nodes for i in range(8)}


def read_head(reader, model):
    has_full = reader.bit(32768)
    occupied, full = {(0, 0, 0)}, set()
    for level in range(5):
        inside = children(full)
        occupied = read_occupied(reader, model, occupied, full, 2 << level, 3)
        full = read_full(reader, occupied, inside) if has_full else set()
    return occupied, full


def read_cells(reader, model, bricks, full):
    occupied = bricks
    for level in (2, 1, 0):
        occupied = read_occupied(reader, model, occupied, full, 0, level)
        full = children(full)
    return occupied - full


def octant_of(brick):
    return packed([c >> 4 for c in brick])


def read_octree(data):
    """Cells with attributes, full bricks."""
    if data[0] == 2:
        assert len(data) == 1
        return set(), {(x, y, z) for x in range(32) for y in range(32) for z in range(32)}
    model = Model()
    if data[0] == 0:
        reader = Reader(data[1:])
        bricks, full = read_head(reader, model)
        cells = read_cells(reader, model, bricks, full)
        reader.close()
        return cells, full
    sizes = [int.from_bytes(data[1 + 4 * i:5 + 4 * i], "little") for i in range(9)]
    at = 37 + sizes[0]
    reader = Reader(data[37:at])
    bricks, full = read_head(reader, model)
    reader.close()
    cells = set()
    for octant, size in enumerate(sizes[1:]):
        part = {b for b in bricks if octant_of(b) == octant}
        part_full = part & full
        if part == part_full:
            assert size == 0
            continue
        # Cells outside are empty, also at coordinates below 0.
        reader = Reader(data[at:at + size])
        cells |= read_cells(reader, Model(model), part, part_full)
        reader.close()
        at += size
    assert at == len(data)
    return cells, full


def morton(cell):
    return sum((c >> bit & 1) << (3 * bit + axis) for axis, c in enumerate(cell) for bit in range(8))


STEPS = sorted(((x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)
                if (x, y, z) != (0, 0, 0)), key=lambda s: (sum(map(abs, s)), s[2], s[1], s[0]))


def z_of(n):
    return next(i for i, end in enumerate((0, 1, 2, 4, 8, 16, 32, 1 << 30)) if n <= end)


def s_of(d):
    size = next(i for i, end in enumerate((0, 1, 4, 16, 1 << 30)) if abs(d) <= end)
    return size + 4 if d < 0 else size


def read_size(bit):
    length = 1
    while length < 8 and bit(2 + length - 1):
        length += 1
    value = 1
    for below in range(length - 1, 0, -1):
        done = length - 1 - below
        node = 10 + length if done == 0 else 20 + 2 * length + (value & 1) if done == 1 else 48 + below
        value = value << 1 | bit(node)
    return value


class Voxel:
    """Facts that are known before a voxel's samples are: the samples of its coded neighbours."""

    def __init__(self, cell, samples, errors, before, components, middle):
        known = []
        for step in STEPS:
            other = tuple(a + b for a, b in zip(cell, step))
            if other in samples:
                known.append((samples[other], 4 - sum(map(abs, step)), errors[other]))
        self.cell, self.samples, self.count = cell, samples, len(known)
        self.spread, self.error = [0] * components, 0
        if not known:
            self.first = before
            self.mean = list(before) if before else [middle] * components
        else:
            self.first = known[0][0]
            total = sum(w for _, w, _ in known)
            self.mean = [(sum(w * s[c] for s, w, _ in known) + total // 2) // total
                         for c in range(components)]
            self.spread = [max(s[c] for s, _, _ in known) - min(s[c] for s, _, _ in known)
                           for c in range(components)]
            self.error = sum(e for _, _, e in known) // len(known)
        others = [s for s, _, _ in known if s != self.first]
        self.other = others[0] if others else self.first
        self.same = sum(s == self.first for s, _, _ in known)

    def back(self, *axes):
        """The sample one step back along the axes, or None."""
        cell = tuple(c - (axis in axes) for axis, c in enumerate(self.cell))
        return self.samples[cell][0] if cell in self.samples else None


def read_difference(bit):
    if not bit(0):
        return 0
    sign = -1 if bit(1) else 1
    return sign * read_size(bit)


def read_bytes(voxel, context, is_normal, is_color):
    """Samples of 8 bits and the sum of their errors."""
    mean = voxel.mean
    order = range(len(mean))
    if is_normal:
        last = max(range(3), key=lambda c: (abs(mean[c] - 128), c))
        order = [c for c in range(3) if c != last] + [last]
    elif is_color:
        order = [1, 0, 2, 3]
    out, told = [0] * len(mean), []
    for i, c in enumerate(order):
        predicted = mean[c]
        if is_normal and i == 2:
            a, b = (out[o] - 128 for o in order[:2])
            r = math.isqrt(max(0, 127 * 127 - a * a - b * b))
            predicted = 128 + r if mean[c] >= 128 else 128 - r
        elif is_color and c in (0, 2):
            predicted = max(0, min(255, mean[c] + out[1] - mean[1]))
        difference = read_difference(context(i, voxel.spread[c], s_of(told[-1]) if told else 0,
                                             s_of(told[-2]) if len(told) > 1 else 0,
                                             predicted >> 2))
        told.append(difference)
        out[c] = (predicted + difference) & 255
    return tuple(out), sum(map(abs, told))


def read_word(voxel, context, is_distance):
    """One sample of 16 bits and the size of its error."""
    predicted = voxel.other[0] if voxel.count else voxel.mean[0]
    if is_distance:
        planes = [(voxel.back(a), voxel.back(b), voxel.back(a, b))
                  for a, b in ((0, 1), (0, 2), (1, 2))]
        planes = [a + b - ab for a, b, ab in planes if None not in (a, b, ab)]
        predicted = (max(0, min(65535 * len(planes), sum(planes))) // len(planes) if planes
                     else voxel.mean[0])
    high = read_difference(context(0, voxel.spread[0], 0, 0, predicted >> 10))
    low = read_difference(context(1, voxel.spread[0], s_of(high), 0, predicted >> 10))
    difference = (256 * high + low + 32768) % 65536 - 32768
    return ((predicted + difference) & 65535,), abs(difference)


def read_channel(name, data, cells):
    components = {"color": 4, "normal": 3}.get(name, 1)
    is_word = name in ("material", "label", "distance")
    reader, model = Reader(data), Model()
    samples, errors, before = {}, {}, None
    for number, cell in enumerate(sorted(cells, key=morton)):
        voxel = Voxel(cell, samples, errors, before, components, 32768 if is_word else 128)

        def context(i, r, b, a, h):
            def bit(node):
                n, e, c = i << 6 | node, z_of(voxel.error), min(voxel.count, 3)
                values = (n | e << 8 | z_of(r) << 11, n | b << 8 | a << 12, n,
                          n | e << 8 | b << 11 | c << 15, n | h << 8 | z_of(r) << 14)
                return model.bit(reader, values, i << 3 | min(node, 7))
            return bit

        if number > 0 and context(0, voxel.spread[0], min(voxel.same, 15), min(voxel.count, 15),
                                  min(voxel.same, 7) << 3 | min(voxel.count, 7))(63):
            before, error = voxel.first, 0
        elif is_word:
            before, error = read_word(voxel, context, name == "distance")
        else:
            before, error = read_bytes(voxel, context, name == "normal", name == "color")
        samples[cell], errors[cell] = before, min(255, error)
    reader.close()
    offset = {"normal": 128, "distance": 32768}.get(name, 0)
    return {cell: tuple(s - offset for s in values) for cell, values in samples.items()}


def read_tile(streams):
    cells, full = read_octree(streams["octree"])
    grid = {cell: {} for cell in cells}
    for name, data in streams.items():
        if name == "octree" or not cells:
            continue
        for cell, values in read_channel(name, data, cells).items():
            grid[cell][name] = values
    for bx, by, bz in full:
        for i in range(512):
            grid[(8 * bx + i % 8, 8 * by + i // 8 % 8, 8 * bz + i // 64)] = {}
    return grid
