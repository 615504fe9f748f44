# SPDX-License-Identifier: MIT
"""Section 5 of docs/bitstream.md: the limits of the levels, the figures of a
header that they limit, and headers at each limit and just above."""

NAMES = ("work_bytes", "coarse", "fine", "prim", "weights", "width", "int8",
         "slots", "anchors", "work")
# int8 counts the networks that are not int8.
CAPS = (
    (262144, 512, 512, 1024, 48000, 32, 0, 32, 5120, 2**28),
    (4194304, 16000, 16000, 16000, 128000, 64, 99, 64, 160000, 2**32),
    (33554432, 160000, 160000, 160000, 128000, 64, 99, 128, 1600000, 2**35),
    (1073741824, 4194304, 4194304, 4194304, 524288, 128, 99, 512, 8388608,
     2**39),
)
NETS = ("hyper", "e_coarse", "e_fine", "e_prim", "fuse_c", "fuse_f", "fine",
        "geo", "colour_base", "colour_view", "colour")
BANK_NETS = ("query", "agg", "slot", "write_base", "write")
HYPER, BANK = 1, 8
VIEW, SLOPE, OPACITY_T = 4, 2, 1
HAS_BASE, HAS_HASH, HAS_BANK, PLAIN_WRITE, HAS_CLASSES = (
    1 << 5, 1 << 8, 1 << 9, 1 << 10, 1 << 11)


class Figures:
    """Computes the quantities that levels limit from a header, whose fields h
    has by their names."""

    def __init__(self, h):
        self.h = h
        self.tools = h["tools"]
        self.bank = bool(self.tools & HAS_BANK)
        self.F, self.octaves = h["features"], h["octaves"]
        self.L, self.D = h["bank_slots"], h["bank_width"]
        self.C, self.V = self.width("colour"), self.width("write")
        names = (NETS + (BANK_NETS if self.bank else ()) +
                 (("res",) if self.tools & HAS_HASH else ()))
        self.layers = {net: self.shape(net) for net in names}
        self.widths = [self.width(net) for net in names]
        self.floats = sum(not h[f"net_{net}.int8"] for net in names)

    def width(self, net):
        return self.h.get(f"net_{net}.width", 0)

    def sources(self):
        return [self.h[f"sources_{kind}"] for kind in ("coarse", "fine",
                                                       "prim")]

    def inputs(self, sources):
        return (self.F * bin(sources & 7).count("1") +
                (self.D if sources & BANK else 0))

    def rows_of_geo(self):
        tools, order = self.tools, self.tools >> 3 & 3
        dynamic = tools & (OPACITY_T | SLOPE) or order
        return (8 + (4 if tools & SLOPE else 0) + (1 if dynamic else 0) +
                (1 if tools & OPACITY_T else 0) + 3 * order)

    def shape(self, net):
        """Returns the numbers of inputs and outputs of a network's layers
        (section 9)."""
        pe, F, C, V, L, D = 8 * self.octaves, self.F, self.C, self.V, \
            self.L, self.D
        w = self.width(net)
        coarse, fine, prim = self.sources()
        local = F + pe

        def deep(n_in, n_out):
            if w == 0 or n_in == 0:
                return [(n_in, n_out)]
            return [(n_in, w), (w, w), (w, n_out)]

        def two(n_in, n_out):
            return [(n_in, w), (w, n_out)]

        if net == "hyper":
            return deep(pe + 5, F) if (coarse | fine | prim) & HYPER else []
        if net in ("fuse_c", "fuse_f"):
            return two(local, F) if w else []
        return {
            "e_coarse": lambda: deep(self.inputs(coarse), 2 * (4 + F)),
            "e_fine": lambda: deep(self.inputs(fine), 8),
            "e_prim": lambda: deep(self.inputs(prim), 8),
            "fine": lambda: deep(local, F + 4),
            "geo": lambda: deep(local, self.rows_of_geo()),
            "colour_base": lambda: [(local, C)],
            "colour_view": lambda: [(3, C)] if self.tools & VIEW else [],
            "colour": lambda: [(C, C), (C, 3)],
            "query": lambda: two(local + 6, D),
            "agg": lambda: two(local + 6, D),
            "slot": lambda: two(L, V),
            "write_base": lambda: [(D, V)],
            "write": lambda: [(V, D + 1)],
            "res": lambda: two(self.h["hash_levels"] <<
                               self.h["hash_log2_entries"],
                               self.rows_of_geo() + C),
        }[net]()

    def products(self, net):
        return sum(a * b for a, b in self.layers[net])

    def run(self, net):
        return 4096 + self.products(net) if self.layers[net] else 0

    def counts(self, prefix):
        return [self.h.get(f"{prefix}_{kind}", 0)
                for kind in ("coarse", "fine", "prim")]

    def entropy(self, kind, sources):
        cost = self.run(f"e_{kind}")
        if sources & HYPER:
            cost += self.run("hyper")
        if sources & BANK:
            cost += self.run("query") + 2 * self.L * self.D
        return cost

    def rounds(self, tier, n):
        groups = self.h[f"tier_{tier}.n_groups"]
        if n <= groups:
            return n
        return groups + (n - groups) // self.h["bank_blocks"]

    def bank_work(self, nc, nf):
        if not self.bank:
            return 0
        plain = self.tools & PLAIN_WRITE
        write = self.run("write_base") + self.L * (
            self.run("write") + self.D * (3 if plain else 5))
        work = (self.L * (self.run("slot") + 2 * self.D) +
                self.run("agg") * nc + write * self.rounds("coarse", nc))
        if (self.sources()[1] | self.sources()[2]) & BANK:
            work += self.run("agg") * nf + write * self.rounds("fine", nf)
        return work

    def scaffold(self, nc, nf, np):
        coarse, fine, prim = self.sources()
        view = self.tools & VIEW
        return (nc * self.entropy("coarse", coarse) +
                nf * (self.entropy("fine", fine) + self.entropy("prim", prim) +
                      self.run("fuse_c") + self.run("fine")) +
                np * (self.run("fuse_f") + self.run("geo") +
                      self.run("colour_base") +
                      (self.run("res") if self.tools & HAS_HASH else 0) +
                      (0 if view else self.run("colour"))) +
                self.bank_work(nc, nf))

    def work(self):
        nc, nf, np = self.counts("max")
        work = self.scaffold(nc, nf, np)
        work += self.h["more_layers"] * self.scaffold(nc, nf, 0)
        if self.tools & HAS_BASE:
            work += self.scaffold(*self.counts("n"))
        return work

    def work_bytes(self):
        def up(x):
            return (x + 15) & ~15
        nets = sum(up(up(a) * b * (1 if self.h[f"net_{net}.int8"] else 2) +
                      5 * b)
                   for net, layers in self.layers.items() for a, b in layers)
        bank = 0
        if self.bank:
            L, D, V = self.L, self.D, self.V
            bank = 2 * L * up(D) + 2 * L * D + 2 * L * V + 6 * L + up(388)
        nc, nf, np = (max(a, b) for a, b in zip(self.counts("max"),
                                                self.counts("n")))
        every = self.counts("max")[2] + self.counts("n")[2]
        s = self.C if self.tools & VIEW else 3
        F = self.F
        classes = up(1088) if self.tools & HAS_CLASSES else 0
        return (768 + 2 * up(F) + nets + up(6630) + up(4224) + classes +
                up(72 * every) + up(2 * s * every) +
                max(bank + up(32 * nc) + up(2 * F * nc) + up(48 * nf) +
                    up(2 * F * nf) + up(8 * np),
                    up(44 * every) + 2 * up(8 * every)))

    def all(self):
        nc, nf, np = (a + b for a, b in zip(self.counts("max"),
                                            self.counts("n")))
        layers = self.h["more_layers"] + 1
        most = self.counts("max")
        anchors = layers * (most[0] + most[1]) + sum(self.counts("n")[:2])
        return (self.work_bytes(), nc, nf, np,
                sum(self.products(net) for net in self.layers),
                max(self.widths), self.floats, self.L, anchors, self.work())


def exceeded(level, h):
    return [name for name, value, cap in zip(NAMES, Figures(h).all(),
                                             CAPS[level]) if value > cap]


def thin(h, level):
    """Returns h with the smallest model that has the same tools."""
    h = dict(h, level=level, more_layers=0, sources_coarse=0, sources_fine=0,
             sources_prim=0, features=5, octaves=1, max_coarse=1, max_fine=0,
             max_prim=0)
    for name in list(h):
        if name.startswith("net_"):
            h[name] = 1          # width, int8; q_in may be 1
        if name.startswith("class_"):
            h[name] = 0          # no feature is coded, and feature 0 is 1
    for name in ("n_coarse", "n_fine", "n_prim"):
        if name in h:
            h[name] = int(name == "n_coarse")
    if h["tools"] & HAS_BANK:
        h.update(sources_coarse=BANK, bank_slots=32, bank_width=8,
                 bank_blocks=1)
    if h["tools"] & HAS_HASH:
        h.update(hash_levels=1, hash_log2_entries=1)
    return h


def last_below(level, limit, h, set_value, most):
    """Returns two headers: with the largest value that keeps the limit, and
    with the next value. Returns None if another limit is exceeded first."""
    low, high = 0, most
    while high - low > 1:
        middle = (low + high) // 2
        if limit in exceeded(level, set_value(h, middle)):
            high = middle
        else:
            low = middle
    keeps, breaks = set_value(h, low), set_value(h, high)
    if exceeded(level, keeps) or exceeded(level, breaks) != [limit]:
        return None
    return keeps, breaks


def with_field(*names):
    return lambda h, value: dict(h, **{name: value for name in names})


def wide(h, width, features=64):
    """Returns h with networks that all have this width (that of the colour at
    most 32) and all inputs."""
    h = dict(h, features=features, octaves=8, sources_coarse=5, sources_fine=7,
             sources_prim=3)
    for net in NETS:
        h[f"net_{net}.width"] = min(width, 32) if net == "colour" else width
    return h


def trials(level, h):
    """Yields for each limit a header to begin with, a function that sets the
    growing field, and the field's largest value."""
    width = CAPS[level][5]
    if h["tools"] & HAS_CLASSES:
        # Classes change no other limit.
        for share in (1, 2):
            yield ("work_bytes",
                   dict(wide(h, 8), max_coarse=CAPS[level][1] // share,
                        max_prim=CAPS[level][3] // share),
                   with_field("max_fine"), 2**22)
        return
    for kind in ("coarse", "fine", "prim"):
        yield kind, h, with_field(f"max_{kind}"), 2**22 + 2
        if "n_coarse" in h:
            yield kind, h, with_field(f"n_{kind}"), 2**22 + 2
    for net in NETS:
        # A wider net_colour is DATA at every level.
        if width < 128 and net != "colour":
            yield "width", h, with_field(f"net_{net}.width"), 129
        if level == 0:
            yield ("int8", h,
                   lambda h, v, n=net: dict(h, **{f"net_{n}.int8": v < 1}), 1)
    if h["tools"] & HAS_BANK:
        for net in BANK_NETS:
            if width < 128:
                yield "width", h, with_field(f"net_{net}.width"), 129
            if level == 0:
                yield ("int8", h, lambda h, v, n=net: dict(
                    h, **{f"net_{n}.int8": v < 1}), 1)
        if level < 3:
            yield ("slots", dict(h, bank_width=16),
                   lambda h, v: dict(h, bank_slots=32 << min(v, 4)), 4)
        everything = wide(h, width)
        for kind in ("coarse", "fine", "prim"):
            everything[f"sources_{kind}"] |= BANK
        if level == 3 and h["tools"] & HAS_HASH:
            everything.update(hash_levels=8, hash_log2_entries=6)
            for net in (*BANK_NETS, "res"):
                everything[f"net_{net}.width"] = width
        for net in ("query", "agg", "slot", "write", "e_prim"):
            everything["bank_slots"] = CAPS[level][7]
            everything["bank_width"] = 64
            yield ("weights", everything, with_field(f"net_{net}.width"), width)
        for plain in (0, PLAIN_WRITE):
            yield ("work", dict(h, more_layers=7, tools=h["tools"] | plain,
                                bank_slots=CAPS[level][7],
                                bank_width=16), with_field("max_coarse"),
                   2**22)
        return
    if h["tools"] & HAS_HASH:
        if width < 128:
            yield "width", h, with_field("net_res.width"), 129
        if level == 0:
            yield ("int8", h, lambda h, v: dict(h, **{"net_res.int8": v < 1}),
                   1)
        full = dict(wide(h, width), hash_levels=8, hash_log2_entries=6)
        yield "weights", full, with_field("net_res.width"), width
        yield ("work", dict(full, max_fine=1, max_coarse=1),
               with_field("max_prim"), 2**22)
        return
    for share in range(1, 9):
        for net in ("e_coarse", "e_fine", "e_prim", "fuse_c", "fuse_f"):
            yield ("weights", wide(h, width * share // 8),
                   with_field(f"net_{net}.width"), width)
    for w in (1, 4, 8, 16):
        yield ("work_bytes", dict(wide(h, w), max_coarse=CAPS[level][1] - 1,
                                  max_prim=CAPS[level][3]),
               with_field("max_fine"), CAPS[level][2])
    narrow = wide(h, 8)
    yield "work_bytes", narrow, with_field("max_prim"), 2**22
    for share in (2, 3, 4):
        most = CAPS[level][1] // share
        yield ("work_bytes", dict(narrow, max_coarse=most),
               with_field("max_fine"), 2**22)
        yield ("work_bytes", dict(wide(h, 4), max_prim=CAPS[level][3] // share),
               with_field("max_fine"), 2**22)
        yield ("work", dict(wide(h, min(width, 32), 32), more_layers=7,
                            max_fine=most), with_field("max_coarse"), 2**22)
        yield ("work", dict(wide(h, width // share, 16),
                            max_fine=most, max_coarse=most),
               with_field("max_prim"), 2**22)
    for layers in range(8):
        yield ("anchors", dict(h, more_layers=layers, max_coarse=1),
               with_field("max_fine"), 2**22)
        yield ("anchors", dict(h, more_layers=layers,
                               max_fine=CAPS[level][2] // 2),
               with_field("max_coarse"), 2**22)


def pairs(h, level):
    """Yields (limit, header at it, header above it, changed fields) for all
    limits that a header alone can exceed, at most one for each limit and
    growing field."""
    small, found = thin(h, level), set()
    for limit, begin, grow, most in trials(level, small):
        pair = last_below(level, limit, begin, grow, most)
        changed = pair and tuple(k for k in pair[0] if pair[0][k] != pair[1][k])
        if pair and (limit, changed) not in found:
            found.add((limit, changed))
            yield limit, pair[0], pair[1], changed
