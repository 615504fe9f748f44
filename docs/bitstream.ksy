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
  header:
    seq:
      - id: magic
        contents: SAGA
      - id: version
        type: u2
        valid:
          min: 1
          max: 1
      - id: reserved
        type: u2
        valid:
          max: 0
      - id: header_nbytes
        type: u4
        valid:
          min: 178
          max: 84193
      - id: level
        type: u1
        valid:
          max: 3
      - id: more_layers
        type: u1
        valid:
          max: 7
      - id: n_cameras
        type: u2
        valid:
          max: 1024
      - id: n_segments
        type: u4
        valid:
          min: 1
          max: 1048576
      - id: n_frames
        type: u4
        valid:
          min: 1
      - id: fps_num
        type: u4
        valid:
          min: 1
      - id: fps_den
        type: u4
        valid:
          min: 1
      - id: max_coarse
        type: u4
        valid:
          min: 1
          max: 4194304
      - id: max_fine
        type: u4
        valid:
          max: 4194304
      - id: max_prim
        type: u4
        valid:
          max: 4194304
      - id: nets_nbytes
        type: u4
        valid:
          max: 268435456
      - id: unit_mantissa
        type: s4
      - id: unit_exponent
        type: s4
      - id: centre_mantissa
        type: s4
        repeat: expr
        repeat-expr: 3
      - id: centre_exponent
        type: s4
      - id: tools
        type: u4
        valid:
          expr: (_ >= 0 and _ <= 127) or (_ >= 256 and _ <= 383) or (_ >= 512 and _ <= 639) or (_ >= 768 and _ <= 895) or (_ >= 1536 and _ <= 1663) or (_ >= 1792 and _ <= 1919) or (_ >= 2048 and _ <= 2175) or (_ >= 2304 and _ <= 2431) or (_ >= 2560 and _ <= 2687) or (_ >= 2816 and _ <= 2943) or (_ >= 3584 and _ <= 3711) or (_ >= 3840 and _ <= 3967)
      - id: sources_coarse
        type: u1
        valid:
          any-of: [0, 1, 4, 5, 8, 9, 12, 13]
      - id: sources_fine
        type: u1
        valid:
          max: 15
      - id: sources_prim
        type: u1
        valid:
          expr: (_ >= 0 and _ <= 3) or (_ >= 8 and _ <= 11)
      - id: features
        type: u1
        valid:
          min: 5
          max: 64
      - id: octaves
        type: u1
        valid:
          min: 1
          max: 8
      - id: lambda_t_q8
        type: u2
      - id: tier_coarse
        type: tier
      - id: tier_fine
        type: tier
      - id: step_centre_q16
        type: u4
        valid:
          min: 1048576
      - id: step_feature_q16
        type: u4
        valid:
          min: 1048576
      - id: step_fine_q16
        type: u4
        valid:
          min: 1048576
      - id: step_prim_q16
        type: u4
        valid:
          min: 1048576
      - id: q_coarse
        type: u1
        valid:
          max: 20
      - id: q_hyper
        type: u1
        valid:
          max: 20
      - id: q_sigma
        type: u1
        valid:
          max: 20
      - id: q_fuse_c
        type: u1
        valid:
          max: 20
      - id: q_fuse_f
        type: u1
        valid:
          max: 20
      - id: q_fine
        type: u1
        valid:
          max: 20
      - id: q_support
        type: u1
        valid:
          max: 20
      - id: q_opacity
        type: u1
        valid:
          max: 20
      - id: q_scale
        type: u1
        valid:
          max: 20
      - id: q_quat
        type: u1
        valid:
          max: 14
      - id: q_slope
        type: u1
        valid:
          max: 20
      - id: q_time
        type: u1
        valid:
          max: 20
      - id: q_width
        type: u1
        valid:
          max: 20
      - id: q_motion1
        type: u1
        valid:
          max: 20
      - id: q_motion2
        type: u1
        valid:
          max: 20
      - id: q_motion3
        type: u1
        valid:
          max: 20
      - id: q_colour
        type: u1
        valid:
          max: 20
      - id: net_hyper
        type: network
      - id: net_e_coarse
        type: network
      - id: net_e_fine
        type: network
      - id: net_e_prim
        type: network
      - id: net_fuse_c
        type: network
      - id: net_fuse_f
        type: network
      - id: net_fine
        type: network
      - id: net_geo
        type: network
      - id: net_colour_base
        type: network
      - id: net_colour_view
        type: network
      - id: net_colour
        type: network
      - id: bank_slots
        type: u2
        valid:
          any-of: [0, 32, 64, 128, 256, 512]
      - id: bank_width
        type: u1
        valid:
          any-of: [0, 8, 16, 24, 32, 40, 48, 56, 64]
      - id: bank_blocks
        type: u2
      - id: hash_levels
        type: u1
        valid:
          max: 8
      - id: hash_log2_entries
        type: u1
        valid:
          max: 9
  bank_networks:
    seq:
      - id: net_query
        type: network
      - id: net_agg
        type: network
      - id: net_slot
        type: network
      - id: net_write_base
        type: network
      - id: net_write
        type: network
  hash_network:
    seq:
      - id: net_res
        type: network
  base:
    seq:
      - id: n_coarse
        type: u4
        valid:
          min: 1
          max: 4194304
      - id: n_fine
        type: u4
        valid:
          max: 4194304
      - id: n_prim
        type: u4
        valid:
          max: 4194304
      - id: nbytes
        type: u4
        valid:
          max: 1073741824
  classes:
    seq:
      - id: n_classes
        type: u1
        valid:
          min: 2
          max: 4
      - id: class_0
        type: class
      - id: class_1
        type: class
      - id: class_2
        type: class
      - id: class_3
        type: class
  class:
    seq:
      - id: first
        type: u1
        valid:
          max: 64
      - id: n
        type: u1
        valid:
          max: 64
      - id: one
        type: u1
        valid:
          max: 64
  tier:
    seq:
      - id: n_groups
        type: u1
        valid:
          min: 1
          max: 16
      - id: window
        type: u1
        valid:
          max: 32
      - id: neighbours
        type: u1
        valid:
          min: 1
          max: 16
      - id: suffix_bits
        type: u1
        valid:
          max: 8
      - id: max_children
        type: u1
        valid:
          min: 1
          max: 16
      - id: radius2_q12
        type: u2
      - id: softmax_q8
        type: u2
        valid:
          min: 1
  network:
    seq:
      - id: width
        type: u1
        valid:
          max: 128
      - id: q_in
        type: u1
        valid:
          min: 1
          max: 15
      - id: int8
        type: u1
        valid:
          max: 1
  camera:
    seq:
      - id: number
        type: u4
      - id: rotation_q30
        type: s4
        repeat: expr
        repeat-expr: 9
        valid:
          min: -1859828213
          max: 1859828213
      - id: centre
        type: s4
        repeat: expr
        repeat-expr: 3
        valid:
          min: -536870912
          max: 536870912
      - id: focal_q16
        type: s4
        repeat: expr
        repeat-expr: 2
        valid:
          min: 1
      - id: principal_q16
        type: s4
        repeat: expr
        repeat-expr: 2
        valid:
          min: -1073741824
          max: 1073741824
      - id: near_plane
        type: s4
        valid:
          min: 1
      - id: width
        type: u2
        valid:
          min: 1
          max: 16384
      - id: height
        type: u2
        valid:
          min: 1
          max: 16384
      - id: background_q15
        type: u2
        repeat: expr
        repeat-expr: 3
        valid:
          max: 32768
  chunk_header:
    seq:
      - id: type
        size: 4
      - id: nbytes
        type: u4
      - id: crc
        type: u4
  index_entry:
    seq:
      - id: offset
        type: u8
      - id: nbytes
        type: u4
      - id: n_frames
        type: u4
        valid:
          min: 1
  names:
    seq:
      - id: metre_mantissa
        type: s4
      - id: metre_exponent
        type: s4
  name:
    seq:
      - id: shared
        type: u1
        valid:
          max: 63
      - id: more
        type: u1
        valid:
          max: 63
  exposure:
    seq:
      - id: gain_q12
        type: u2
        repeat: expr
        repeat-expr: 3
        valid:
          min: 256
  sound:
    seq:
      - id: start
        type: s4
  volume:
    seq:
      - id: pivot
        type: s4
        repeat: expr
        repeat-expr: 3
        valid:
          min: -536870912
          max: 536870912
      - id: distance_min
        type: u4
        valid:
          max: 1073741824
      - id: distance_max
        type: u4
        valid:
          max: 1073741824
      - id: floor
        type: s4
      - id: up
        type: s2
        repeat: expr
        repeat-expr: 3
      - id: front
        type: s2
        repeat: expr
        repeat-expr: 3
      - id: azimuth
        type: u2
        valid:
          max: 32768
      - id: elevation_min
        type: s2
        valid:
          min: -16384
          max: 16384
      - id: elevation_max
        type: s2
        valid:
          min: -16384
          max: 16384
      - id: turn
        type: u2
        valid:
          max: 32768
      - id: start
        type: u2
      - id: quality_q8
        type: u2
        repeat: expr
        repeat-expr: 2
  segment_header:
    seq:
      - id: number
        type: u4
        valid:
          max: 1048575
      - id: first_frame
        type: u4
      - id: n_frames
        type: u4
        valid:
          min: 1
  layer:
    seq:
      - id: n_coarse
        type: u4
        valid:
          min: 1
          max: 4194304
      - id: n_fine
        type: u4
        valid:
          max: 4194304
      - id: n_prim
        type: u4
        valid:
          max: 4194304
      - id: nbytes
        type: u4
        if: _root.n_layers > 1
