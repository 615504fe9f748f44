# SPDX-License-Identifier: MIT
"""Reads a good vector by the tables of docs/bitstream.md, and edits it."""
import os

import page


def crc_table():
    table = []
    for i in range(256):
        for _ in range(8):
            i = i >> 1 ^ (0x82f63b78 if i & 1 else 0)
        table.append(i)
    return table


TABLE = crc_table()


def crc32c(crc, data):
    crc ^= 0xffffffff
    for byte in data:
        crc = TABLE[(crc ^ byte) & 255] ^ crc >> 8
    return crc ^ 0xffffffff


class Place:
    """A field of the bitstream, with its offset in the file."""

    def __init__(self, at, field):
        self.at, self.size, self.count = at, field.size, field.count
        self.signed, self.ranges = field.signed, field.ranges


class Chunk:
    def __init__(self, at, nbytes, owner):
        self.at, self.owner = at, owner
        self.nbytes = 12 + nbytes
        self.end = at + self.nbytes


class Film:
    """A good vector. `fields` has its fields by their names, such as
    header.tier_fine.window, base.n_prim, camera0.width, INDX.nbytes,
    index1.n_frames, segment0.layer0.n_coarse; `chunks` has its chunks, such
    as NETS, base.COAR, segment0.layer1.PRIM."""

    def __init__(self, folder, name):
        self.name = name
        with open(os.path.join(folder, name), "rb") as f:
            self.data = f.read()
        self.fields, self.chunks = {}, {}
        self.read_header()
        self.read_head()
        self.n_segments = self.get("header.n_segments")
        self.segments = [self.read_segment(i) for i in range(self.n_segments)]

    def add(self, prefix, structure, at):
        """Adds all fields of a structure that begins at `at`. Returns where it
        ends."""
        for field in page.structures[structure]:
            name = f"{prefix}.{field.name}"
            if field.type in page.structures:
                self.add(name, field.type, at + field.offset)
            else:
                self.fields[name] = Place(at + field.offset, field)
        return at + page.sizes[structure]

    def field(self, name):
        return self.fields[name]

    def place(self, name):
        """Returns offset and size of a field, or of the element name[k]."""
        k = 0
        if name.endswith("]"):
            name, k = name[:-1].split("[")
        field = self.fields[name]
        return field.at + int(k) * field.size, field.size

    def get(self, name):
        at, size = self.place(name)
        return int.from_bytes(self.data[at:at + size], "little")

    def chunk(self, label):
        return self.chunks[label]

    def crc(self, label):
        return self.get(f"{label}.crc")

    def segment(self, number):
        return self.segments[number]

    def read_header(self):
        at = self.add("header", "Header", 0)
        tools = self.get("header.tools")
        if tools & 1 << 9:
            at = self.add("bank", "Bank networks", at)
        if tools & 1 << 8:
            at = self.add("hash", "Hash network", at)
        self.has_base = bool(tools & 1 << 5)
        if self.has_base:
            at = self.add("base", "Base", at)
        if tools & 1 << 11:
            at = self.add("classes", "Classes", at)
        for i in range(self.get("header.n_cameras")):
            at = self.add(f"camera{i}", "Camera", at)
        self.fields["header.crc"] = Place(at, page.Field(
            ["0", "4", "u32", "crc", "any"]))
        self.header_nbytes = at + 4

    def add_chunk(self, label, at, owner):
        self.add(label, "Chunk header", at)
        self.chunks[label] = Chunk(at, self.get(f"{label}.nbytes"), owner)
        return self.chunks[label].end

    def read_head(self):
        at = self.add_chunk("INDX", self.header_nbytes, "header")
        for i in range(self.get("header.n_segments")):
            self.add(f"index{i}", "Index entry",
                     self.header_nbytes + 12 + i * page.sizes["Index entry"])
        at = self.add_chunk("NETS", at, "header")
        self.last = "NETS"
        for name in ("COAR", "FINE", "PRIM") if self.has_base else ():
            at = self.add_chunk(f"base.{name}", at, self.last)
            self.last = f"base.{name}"
        self.head_nbytes = at
        for name in ("NAME", "EXPO", "OPUS", "VOLU"):
            if self.data[at:at + 4] == name.encode():
                begin, at = at, self.add_chunk(name, at, "NETS")
                for i in range(self.get("header.n_cameras")
                               if name == "EXPO" else 0):
                    self.add(f"exposure{i}", "Exposure", begin + 12 +
                             i * page.sizes["Exposure"])
                if name == "VOLU":
                    self.add("volume", "Volume", begin + 12)

    def read_segment(self, number):
        """Returns where the segment begins and ends."""
        part = f"segment{number}"
        begin = self.get(f"index{number}.offset")
        n_layers = self.get("header.more_layers") + 1
        end = self.add_chunk(f"{part}.SEGM", begin, self.last)
        at = self.add(part, "Segment header", begin + 12)
        for layer in range(n_layers):
            at = self.add(f"{part}.layer{layer}", "Layer", at)
        for layer in range(n_layers):
            middle = f".layer{layer}" if n_layers > 1 else ""
            for name in ("COAR", "FINE", "PRIM"):
                end = self.add_chunk(f"{part}{middle}.{name}", end, self.last)
        return begin, end


class Edit:
    """Edits of a film, each of which replaces bytes. line() writes them, with
    the CRCs computed anew."""

    def __init__(self, film, sign=True):
        self.film, self.sign = film, sign
        self.changes = {}            # at: (n, bytes)
        self.kept = set()            # CRCs that stay wrong
        self.owners = {}             # CRCs that continue others

    def replace(self, at, n, new):
        self.changes[at] = (n, new)
        return self

    def set(self, name, value):
        at, size = self.film.place(name)
        return self.replace(at, size,
                            (value % (1 << 8 * size)).to_bytes(size, "little"))

    def cut(self, at):
        """Ends the file at an offset of the good file."""
        self.changes = {a: c for a, c in self.changes.items() if a < at}
        return self.replace(at, len(self.film.data) - at, b"")

    def damage(self, name):
        """Makes a CRC wrong. The CRCs that continue it are right for the wrong
        value."""
        self.kept.add(name)
        return self.set(name, self.film.get(name) ^ 1)

    def owned(self, label, crc):
        self.owners[label] = crc
        return self

    def add(self, name, by):
        at, size = self.film.place(name)
        old = self.changes.get(at, (size, None))[1]
        value = int.from_bytes(old, "little") if old else self.film.get(name)
        return self.set(name, value + by)

    def moved(self, label, by):
        """Changes the lengths and offsets of everything around a chunk that
        gets `by` more bytes."""
        film = self.film
        begin = film.chunk(label).at
        if label == "NETS":
            self.add("header.nets_nbytes", by)
        if label.startswith("base."):
            self.add("base.nbytes", by)
        for i, (first, end) in enumerate(film.segments):
            if first > begin:
                self.add(f"index{i}.offset", by)
            elif begin < end:
                self.add(f"index{i}.nbytes", by)
        if ".layer" in label:
            self.add(f"{label.rsplit('.', 1)[0]}.nbytes", by)
        return self

    def resize(self, label, by):
        """Makes a chunk `by` bytes longer, or shorter if `by` is negative."""
        chunk = self.film.chunk(label)
        self.add(f"{label}.nbytes", by).moved(label, by)
        if by > 0:
            return self.replace(chunk.end, 0, bytes(by))
        return self.replace(chunk.end + by, -by, b"")

    def surplus(self, label):
        """Adds a byte after a chunk. It is counted in the lengths of everything
        that contains the chunk, but not in the chunk's own."""
        return self.moved(label, 1).replace(self.film.chunk(label).end, 0,
                                            b"\0")

    def without_cameras(self):
        film = self.film
        at = film.place("camera0.number")[0]
        n = film.place("header.crc")[0] - at
        for i in range(film.n_segments):
            self.add(f"index{i}.offset", -n)
        self.set("header.n_cameras", 0).add("header.header_nbytes", -n)
        return self.replace(at, n, b"")

    def payload(self, label, new):
        """Gives a chunk another payload."""
        chunk = self.film.chunk(label)
        by = len(new) - (chunk.nbytes - 12)
        old = self.film.data[chunk.at + 12:chunk.end]
        same = len(os.path.commonprefix([old, new]))
        self.add(f"{label}.nbytes", by).moved(label, by)
        return self.replace(chunk.at + 12 + same, len(old) - same, new[same:])

    def bytes_of(self, begin, end):
        """Returns the edited bytes for a range of the good file. An insertion
        at an offset belongs to the range that ends there."""
        out, at = b"", begin
        for place in sorted(self.changes):
            n, new = self.changes[place]
            inside = begin <= place and place + n <= end
            if not inside or (n == 0 and place == begin) or place == end and n:
                continue
            out += self.film.data[at:place] + new
            at = place + n
        return out + self.film.data[at:end]

    def stored(self, name):
        at, size = self.film.place(name)
        old = self.changes.get(at, (size, self.film.data[at:at + size]))[1]
        return int.from_bytes(old, "little")

    def sign_all(self):
        film = self.film
        at = film.place("header.crc")[0]
        end = min((a for a, (n, _) in self.changes.items()
                   if a + n == len(film.data) and n > 0),
                  default=len(film.data))
        if at < end and "header.crc" not in self.kept:
            self.set("header.crc", crc32c(0, self.bytes_of(0, at)))
        for label, chunk in film.chunks.items():
            if chunk.at >= end or f"{label}.crc" in self.kept:
                continue
            owner = self.owners.get(label, self.stored(f"{chunk.owner}.crc"))
            head = self.bytes_of(chunk.at, chunk.at + 8)
            body = self.bytes_of(chunk.at + 12, chunk.end)
            n = int.from_bytes(head[4:8], "little")
            if n > len(body):        # it claims bytes of what follows
                body = self.bytes_of(chunk.at + 12, chunk.at + 12 + n)
            self.set(f"{label}.crc", crc32c(crc32c(owner, head), body[:n]))

    def whole(self):
        """Returns the edited file."""
        if self.sign:
            self.sign_all()
        return self.bytes_of(0, len(self.film.data))

    def line(self):
        if self.sign:
            self.sign_all()
        parts = []                   # of at, n, bytes: neighbours are joined
        for at in sorted(self.changes):
            n, new = self.changes[at]
            if new == self.film.data[at:at + n]:
                continue
            if parts and sum(parts[-1][:2]) == at:
                parts[-1][1] += n
                parts[-1][2] += new
            else:
                parts.append([at, n, new])
        return " ".join([self.film.name] + [f"{at}:{n}:{new.hex()}"
                                            for at, n, new in parts])
