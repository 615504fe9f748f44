# SPDX-License-Identifier: MIT
"""Volumetric video from Python: pictures and primitives of .saga files.

The module calls the decoder, libsaga.so (`make shared`, `make install`),
through ctypes; encoding runs the program `saga`. Pixels are the same on every
machine.

    import saga
    film = saga.open("scene.saga")
    film.picture(camera=0, frame=3)       # (height, width, 3) of uint8
    film.primitives(frame=3)["mean"]      # (n, 3) in metres
    saga.encode("capture", "scene.saga", primitives=8000)

SAGA_LIBRARY names another library, SAGA another program. Arrays need numpy;
film.pixels() gives bytes without it. A film may be used by one thread at a
time.
"""
import builtins
import ctypes
import ctypes.util
import json
import math
import os
import subprocess
import tempfile
import time
from collections import namedtuple
from fractions import Fraction

__all__ = ["Camera", "Error", "Film", "encode", "open"]

_I32, _U32, _U16, _I16 = (ctypes.c_int32, ctypes.c_uint32, ctypes.c_uint16,
                          ctypes.c_int16)
_SIZE, _PTR = ctypes.c_size_t, ctypes.c_void_p
_OK, _AGAIN, _STOPPED = 0, 1, -21
_ALIGN = 16                  # SAGA_WORK_ALIGN
_TILE, _LIST = 16, 1 << 14
_LARGEST = 1 << 30           # largest work block, that of level 3


class Error(Exception):
    """The decoder refuses a file, a camera or a time; `status` is that of
    saga.h."""

    def __init__(self, what, status=None, tell=True):
        self.status = status
        if status is not None and tell:
            what += ": " + _lib().saga_status_text(status).decode()
        super().__init__(what)


# --- saga.h -----------------------------------------------------------------

class _Struct(ctypes.Structure):
    """A structure with the fields of saga.h; tests/cli/check_python.py
    compares them."""


class Camera(_Struct):
    """saga_camera: a pinhole camera in the file's integers. film.camera()
    returns cameras of the rig; copy one and change its fields."""
    _fields_ = [("rotation_q30", _I32 * 9), ("centre", _I32 * 3),
                ("focal_q16", _I32 * 2), ("principal_q16", _I32 * 2),
                ("near_plane", _I32), ("width", _U16), ("height", _U16),
                ("background_q15", _U16 * 3)]

    def copy(self):
        return Camera.from_buffer_copy(self)


class _Info(_Struct):
    _fields_ = [("version", _U32), ("level", _U32), ("work_nbytes", _SIZE),
                ("head_nbytes", _SIZE), ("n_segments", _U32),
                ("n_frames", _U32), ("fps_num", _U32), ("fps_den", _U32),
                ("n_cameras", _U32), ("n_layers", _U32),
                ("max_coarse", _U32), ("max_fine", _U32),
                ("max_primitives", _U32),
                ("base_coarse", _U32), ("base_fine", _U32),
                ("base_primitives", _U32), ("base_nbytes", _U32),
                ("n_weights", _U32), ("nets_nbytes", _U32), ("tools", _U32),
                ("motion_order", _U32), ("features", _U32),
                ("decode_macs", ctypes.c_uint64),
                ("base_macs", ctypes.c_uint64), ("work", ctypes.c_uint64),
                ("view_macs", _U32),
                ("unit_mantissa", _I32), ("unit_exponent", _I32),
                ("centre_mantissa", _I32 * 3), ("centre_exponent", _I32)]


class _Naming(_Struct):
    _fields_ = [("name", ctypes.c_char * 64), ("metre_mantissa", _I32),
                ("metre_exponent", _I32)]


class _Segment(_Struct):
    _fields_ = [("number", _U32), ("first_frame", _U32), ("n_frames", _U32),
                ("offset", ctypes.c_uint64), ("nbytes", _U32), ("t", _I32)]


class _Picture(_Struct):
    _fields_ = [("rgb", _PTR), ("stride_nbytes", _SIZE), ("nbytes", _SIZE),
                ("bits", ctypes.c_int)]


class _Job(_Struct):
    _fields_ = [("x0", _I32), ("y0", _I32), ("x1", _I32), ("y1", _I32),
                ("tile", _I32), ("list_capacity", _U32), ("scratch", _PTR),
                ("scratch_nbytes", _SIZE), ("cursor", _U32 * 4)]


class _Report(_Struct):
    _fields_ = [("n_layers", _U32), ("n_coarse", _U32), ("n_fine", _U32),
                ("n_primitives", _U32), ("final_range", _U32 * 3),
                ("n_splats", _U32), ("box_pixels", ctypes.c_uint64)]


class _Animated(_Struct):
    _fields_ = [("x", _I32 * 3), ("quat", _I32 * 4),
                ("log2_scale_q10", _I32 * 3), ("q0_q20", _I32)]


_STOP = ctypes.CFUNCTYPE(ctypes.c_int, _PTR)


class _Watch(_Struct):
    _fields_ = [("stop", _STOP), ("user", _PTR)]


_library = None


def _lib():
    """Returns the decoder's library, which is loaded once. It is the one that
    SAGA_LIBRARY names, or the one that was installed or built with this
    file, or the system's."""
    global _library
    if _library:
        return _library
    here = os.path.dirname(os.path.abspath(__file__))
    # The library is in saga.libs beside a wheel's module, in PREFIX/lib if the
    # module is in PREFIX/share/saga/python, and in build/ of the source tree.
    beside = [os.path.normpath(os.path.join(here, at, "libsaga.so.0"))
              for at in ("saga.libs", "../../../lib", "../../../lib64",
                         "../../build")]
    names = [os.environ["SAGA_LIBRARY"]] if "SAGA_LIBRARY" in os.environ \
        else [*filter(os.path.exists, beside), "libsaga.so.0",
              "/usr/local/lib/libsaga.so.0"]
    why = None
    for name in names:
        try:
            lib = ctypes.CDLL(name)
            break
        except OSError as error:
            why = why or error
    else:
        raise ImportError(f"libsaga cannot be loaded ({why}); run `make install`, "
                          "or set SAGA_LIBRARY")
    lib.saga_status_text.restype = ctypes.c_char_p
    lib.saga_crc32c.restype = _U32
    for name, types in (
            ("probe", [_PTR, _PTR, _SIZE]),
            ("open", [_PTR, _PTR, _SIZE, _PTR, _SIZE, _PTR]),
            ("find", [_PTR, _PTR, _SIZE, _U32, _U32]),
            ("rig", [_PTR, _PTR, _PTR, _SIZE, _U32]),
            ("name_camera", [_PTR, _PTR, _SIZE, _U32]),
            ("decode", [_PTR, _PTR, _PTR, _SIZE, _PTR]),
            ("view", [_PTR, _PTR, _I32]), ("draw", [_PTR, _PTR, _PTR, _U32]),
            ("tell", [_PTR, _PTR]),
            ("primitive_at", [_PTR, _PTR, _U32, _I32]),
            ("crc32c", [_U32, ctypes.c_char_p, _SIZE])):
        getattr(lib, "saga_" + name).argtypes = types
    _library = lib
    return lib


def _check(status, what):
    if status != _OK:
        raise Error(what, status)


# --- Films ------------------------------------------------------------------

Info = namedtuple("Info", "name nbytes version level n_frames n_segments fps "
                  "n_cameras n_layers max_primitives memory_nbytes "
                  "metres_per_unit centre_metres")


class Film:
    """An open file. film.info has its properties. Segments are decoded when
    they are needed."""

    def __init__(self, name, data, seconds=None):
        self._data = data
        self._seconds = seconds
        self._watch = None if seconds is None else _Watch(
            _STOP(lambda _: time.monotonic() > self._deadline))
        self._bytes = ctypes.create_string_buffer(data, len(data) or 1)
        self._header = _Info()
        _check(_lib().saga_probe(ctypes.byref(self._header), self._bytes,
                                 len(data)), name)
        h = self._header
        # The level in the header limits the size of the work block, to at most
        # 1 GiB.
        if h.work_nbytes > _LARGEST or h.head_nbytes > len(data):
            raise Error(name + ": the file is cut short")
        self._work = ctypes.create_string_buffer(h.work_nbytes + _ALIGN)
        at = ctypes.addressof(self._work)
        self._dec = _PTR()
        self._decode(name, _lib().saga_open, ctypes.byref(self._dec),
                     at + -at % _ALIGN, h.work_nbytes, self._bytes, len(data))
        self._segment = None
        self.info = Info(
            name, len(data), h.version, h.level, h.n_frames, h.n_segments,
            Fraction(h.fps_num, h.fps_den), h.n_cameras, h.n_layers,
            h.base_primitives + h.max_primitives,
            h.work_nbytes, math.ldexp(h.unit_mantissa, h.unit_exponent),
            tuple(math.ldexp(m, h.centre_exponent)
                  for m in h.centre_mantissa))

    def _decode(self, what, function, *arguments):
        """Calls a function of the decoder with the film's time limit."""
        if self._watch:
            self._deadline = time.monotonic() + self._seconds
        status = function(*arguments, self._watch and
                          ctypes.byref(self._watch))
        if status == _STOPPED:
            raise Error(f"{what}: decoding took more than {self._seconds:g} "
                        f"s; allow more with seconds={6 * self._seconds:g}",
                        status, tell=False)
        _check(status, what)

    def _naming(self, index):
        naming = _Naming()
        _lib().saga_name_camera(ctypes.byref(naming), self._bytes,
                                len(self._data), index)
        return naming

    @property
    def names(self):
        """Names of the cameras of the rig; empty if the file has none."""
        return [self._naming(i).name.decode(errors="replace")
                for i in range(self.info.n_cameras)]

    @property
    def metres(self):
        """Length of the capture's unit in metres, or 0 if the file does not
        state it."""
        naming = self._naming(0)
        return math.ldexp(naming.metre_mantissa, naming.metre_exponent)

    def camera(self, index):
        """Returns a copy of camera `index` of the rig; index may be its
        name."""
        if isinstance(index, str):
            if index not in self.names:
                raise Error(f"{self.info.name}: no camera {index!r} among "
                            f"{self.names}")
            index = self.names.index(index)
        camera, number = Camera(), _U32()
        if not 0 <= index < self.info.n_cameras:
            raise Error(f"{self.info.name}: no camera {index}; it has "
                        f"{self.info.n_cameras} cameras")
        _check(_lib().saga_rig(ctypes.byref(camera), ctypes.byref(number),
                               self._bytes, len(self._data), index),
               self.info.name)
        return camera

    def _seek(self, frame):
        """Decodes the segment that holds a time in frames, which may be a
        Fraction. Returns the time within the segment."""
        time = Fraction(frame).limit_denominator(65536)
        if not 0 <= time < 1 << 32:
            raise Error(f"{self.info.name}: no frame {frame}; it has "
                        f"{self.info.n_frames} frames")
        s = _Segment()
        _check(_lib().saga_find(ctypes.byref(s), self._bytes, len(self._data),
                                time.numerator, time.denominator),
               f"{self.info.name}: frame {frame}")
        if s.number != self._segment:
            self._segment = None
            # A file that ends early may still have complete layers.
            nbytes = min(s.nbytes, len(self._data) - s.offset)
            if nbytes < s.nbytes and (self.info.n_layers == 1 or nbytes < 0):
                raise Error(self.info.name + ": the file is cut short")
            at = ctypes.addressof(self._bytes) + s.offset
            self._decode(f"{self.info.name}: segment {s.number}",
                         _lib().saga_decode, self._dec, ctypes.byref(s), at,
                         nbytes)
            self._segment = s.number
        return s.t

    def layers(self, frame=0):
        """Returns the number of complete layers in the segment of a time. This
        is info.n_layers, or fewer if the file ends early."""
        report = _Report()
        self._seek(frame)
        _check(_lib().saga_tell(ctypes.byref(report), self._dec),
               self.info.name)
        return report.n_layers

    def pixels(self, camera=0, frame=0):
        """Returns a picture as bytes: rows from the top, R, G, B with 8 bits.
        camera is an index or a name of the rig, or a Camera; frame is a
        number, which may be a Fraction."""
        c = camera if isinstance(camera, Camera) else self.camera(camera)
        t = self._seek(frame)
        _check(_lib().saga_view(self._dec, ctypes.byref(c), t),
               self.info.name)
        rgb = ctypes.create_string_buffer(3 * c.width * c.height)
        # There is scratch memory for all tiles at once, up to a limit (see
        # saga_job).
        rows, columns = -(-c.height // _TILE), -(-c.width // _TILE)
        nbytes = 16 * _TILE * _TILE * min(rows * columns, 1 << 14) + \
            8 * _LIST + 264
        scratch = ctypes.create_string_buffer(nbytes + _ALIGN)
        at = ctypes.addressof(scratch)
        job = _Job(0, 0, c.width, c.height, _TILE, _LIST, at + -at % _ALIGN,
                   nbytes)
        picture = _Picture(ctypes.addressof(rgb), 3 * c.width, len(rgb), 8)
        status = _AGAIN
        while status == _AGAIN:
            status = _lib().saga_draw(self._dec, ctypes.byref(job),
                                      ctypes.byref(picture), 0xffffffff)
        _check(status, self.info.name)
        return rgb.raw

    def picture(self, camera=0, frame=0):
        """Returns a picture as a numpy array (height, width, 3) of uint8."""
        import numpy
        c = camera if isinstance(camera, Camera) else self.camera(camera)
        return numpy.frombuffer(self.pixels(c, frame), numpy.uint8).reshape(
            c.height, c.width, 3)

    def primitives(self, frame=0):
        """Returns all primitives at a time as numpy arrays: "mean" (n, 3) in
        metres, "quat" (n, 4) w, x, y, z with length 1, "scale" (n, 3)
        standard deviations in metres, "opacity" (n,)."""
        import numpy
        t, report = self._seek(frame), _Report()
        _check(_lib().saga_tell(ctypes.byref(report), self._dec),
               self.info.name)
        all_of = (_Animated * report.n_primitives)()
        for i, one in enumerate(all_of):
            _check(_lib().saga_primitive_at(ctypes.byref(one), self._dec, i,
                                            t), self.info.name)
        a = numpy.frombuffer(all_of, numpy.dtype(
            [("x", "i4", 3), ("quat", "i4", 4), ("scale", "i4", 3),
             ("q0", "i4")]), report.n_primitives)
        unit = self.info.metres_per_unit
        quat = a["quat"].astype(float)
        quat[~quat.any(1)] = 1, 0, 0, 0
        return {"mean": a["x"] * unit + numpy.array(self.info.centre_metres),
                "quat": quat / numpy.linalg.norm(quat, axis=1)[:, None],
                "scale": numpy.exp2(a["scale"] / 1024) * unit,
                "opacity": numpy.where(a["q0"] < 11 << 20, numpy.exp2(
                    3 - a["q0"] / 2 ** 20), 0.0)}


def open(file, seconds=None):  # noqa: A001 (that is what it does)
    """Opens a Film from a path, or from the bytes of a file. If decoding the
    head, or later a segment, takes more than `seconds`, it raises an Error.
    None means no limit except that of the file's level; files of level 2 take
    at most a few seconds."""
    if isinstance(file, (bytes, bytearray, memoryview)):
        return Film("bytes", bytes(file), seconds)
    with builtins.open(file, "rb") as f:
        return Film(os.fspath(file), f.read(), seconds)


def crc32c(data):
    """Returns the CRC-32C of data, with which pictures are compared."""
    return _lib().saga_crc32c(0, bytes(data), len(data))


def encode(capture, output, **options):
    """Runs `saga encode` and returns its report. Options are those of the
    program with _ instead of -: encode(c, o, primitives=8000,
    hold_out="cam00", still=True)."""
    words = [os.environ.get("SAGA", "saga"), "encode", os.fspath(capture),
             "-o", os.fspath(output), "--json"]
    for name, value in options.items():
        if value is not False and value is not None:
            words.append("--" + name.replace("_", "-"))
            if value is not True:
                words.append(str(value))
    with tempfile.TemporaryFile() as messages:
        done = subprocess.run(words, stdout=subprocess.PIPE, stderr=messages)
        messages.seek(0)
        said = messages.read().decode(errors="replace").strip()
    if done.returncode:
        raise Error(said.splitlines()[-1] if said else
                    f"saga encode ended with {done.returncode}")
    return json.loads(done.stdout)
