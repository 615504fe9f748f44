#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""make_ksy.py: prints docs/bitstream.ksy: the container in the language of
Kaitai Struct. The structures and their ranges come from the tables of
docs/bitstream.md, and what joins them from TOP and JOINED below."""
import page

TYPES = {"u8": "u1", "u16": "u2", "u32": "u4", "u64": "u8", "i16": "s2",
         "i32": "s4"}

TOP = """\
# SPDX-License-Identifier: MIT
# Made by tests/stream/make_ksy.py from the tables of bitstream.md (`make ksy`).
meta:
  id: saga
  title: Volumetric video of saga
  file-extension: saga
  license: MIT
  endian: le
doc: |
  The container: header, cameras, index, chunks, segments and their layers. The
  payloads of NETS, COAR, FINE and PRIM are range coded and stay bytes here.
  Checksums and the rules that join several fields are not checked; section 4
  of bitstream.md has them. Of a file that is cut, the segments that begin in it
  are read, and of several layers those that are complete.
seq:
  - id: header
    type: header
  - id: bank
    type: bank_networks
    if: has_bank
  - id: hash
    type: hash_network
    if: has_hash
  - id: base
    type: base
    if: has_base
  - id: classes
    type: classes
    if: has_classes
  - id: cameras
    type: camera
    repeat: expr
    repeat-expr: header.n_cameras
  - id: crc
    type: u4
  - id: index
    type: index
  - id: nets
    type: chunk
  - id: base_chunks
    type: scaffold
    if: has_base
instances:
  has_bank:
    value: (header.tools & 512) != 0
  has_hash:
    value: (header.tools & 256) != 0
  has_base:
    value: (header.tools & 32) != 0
  has_classes:
    value: (header.tools & 2048) != 0
  n_layers:
    value: header.more_layers + 1
  head_nbytes:
    value: >-
      header.header_nbytes + 24 + 16 * header.n_segments +
      header.nets_nbytes + (has_base ? base.nbytes : 0)
  has_names:
    value: after_head == [78, 65, 77, 69]
  after_head:
    pos: head_nbytes
    size: 4
  names:
    pos: head_nbytes
    type: names_chunk
    if: has_names
  exposures_at:
    value: 'head_nbytes + (has_names ? 12 + names.start.nbytes : 0)'
  after_names:
    pos: exposures_at
    size: 4
  has_exposures:
    value: after_names == [69, 88, 80, 79]
  exposures:
    pos: exposures_at
    type: exposures_chunk
    if: has_exposures
  sound_at:
    value: 'exposures_at + (has_exposures ? 12 + exposures.start.nbytes : 0)'
  after_exposures:
    pos: sound_at
    size: 4
  has_sound:
    value: after_exposures == [79, 80, 85, 83]
  sound:
    pos: sound_at
    type: sound_chunk
    if: has_sound
  volume_at:
    value: 'sound_at + (has_sound ? 12 + sound.start.nbytes : 0)'
  after_sound:
    pos: volume_at
    size: 4
  has_volume:
    value: after_sound == [86, 79, 76, 85]
  volume:
    pos: volume_at
    type: volume_chunk
    if: has_volume
types:
"""

JOINED = """\
  chunk:
    seq:
      - id: start
        type: chunk_header
      - id: payload
        size: start.nbytes
  scaffold:
    seq:
      - id: coarse
        type: chunk
      - id: fine
        type: chunk
      - id: prim
        type: chunk
  index:
    seq:
      - id: start
        type: chunk_header
      - id: entries
        type: located_entry
        repeat: expr
        repeat-expr: _root.header.n_segments
  located_entry:
    seq:
      - id: entry
        type: index_entry
    instances:
      left:
        value: '_root._io.size - entry.offset'
      segment:
        io: _root._io
        pos: entry.offset
        size: 'left < entry.nbytes ? left : entry.nbytes'
        type: segment
        if: left > 0
  segment:
    seq:
      - id: start
        type: chunk_header
      - id: fields
        type: segment_header
      - id: layers
        type: layer
        repeat: expr
        repeat-expr: _root.n_layers
      - id: chunks
        type: scaffold
        repeat: until
        repeat-until: >-
          chunks.size == _root.n_layers or
          layers[chunks.size].nbytes > _io.size - _io.pos
  names_chunk:
    seq:
      - id: start
        type: chunk_header
      - id: unit
        type: names
      - id: names
        type: coded_name
        repeat: expr
        repeat-expr: _root.header.n_cameras
  coded_name:
    seq:
      - id: lengths
        type: name
      - id: rest
        size: lengths.more
  exposures_chunk:
    seq:
      - id: start
        type: chunk_header
      - id: cameras
        type: exposure
        repeat: expr
        repeat-expr: _root.header.n_cameras
  sound_chunk:
    seq:
      - id: start
        type: chunk_header
      - id: fields
        type: sound
      - id: stream
        size: start.nbytes - 4
  volume_chunk:
    seq:
      - id: start
        type: chunk_header
      - id: fields
        type: volume
"""


def valid(field):
    """Returns the lines that state a field's range; none if every value is
    allowed."""
    if not field.ranges:
        return []
    bits = 8 * field.size
    low, high = (-2 ** (bits - 1), 2 ** (bits - 1) - 1) if field.signed else \
        (0, 2 ** bits - 1)
    if len(field.ranges) > 1:
        if all(a == b for a, b in field.ranges):
            return [f"any-of: [{', '.join(str(a) for a, _ in field.ranges)}]"]
        text = " or ".join(f"(_ >= {a} and _ <= {b})" for a, b in field.ranges)
        return [f"expr: {text}"]
    a, b = field.ranges[0]
    return ([f"min: {a}"] if a > low else []) + \
        ([f"max: {b}"] if b < high else [])


def type_lines(name, fields):
    yield f"  {name.lower().replace(' ', '_')}:"
    yield "    seq:"
    for field in fields:
        yield f"      - id: {field.name}"
        if field.type == "u8" and field.count == 4:
            yield "        size: 4" if name != "Header" else \
                "        contents: SAGA"
            continue
        yield "        type: " + TYPES.get(field.type, field.type.lower())
        if field.count > 1:
            yield "        repeat: expr"
            yield f"        repeat-expr: {field.count}"
        if name == "Layer" and field.name == "nbytes":
            yield "        if: _root.n_layers > 1"
        lines = valid(field)
        if lines:
            yield "        valid:"
            yield from ("          " + line for line in lines)


def text():
    lines = [line for name, fields in page.structures.items()
             for line in type_lines(name, fields)]
    return TOP + JOINED + "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(text(), end="")
