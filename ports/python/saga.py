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
film.pixels() gives bytes without it. Threads may share a film: its calls wait
for each other. What is refused because of its value raises Error, what has the
wrong type TypeError.
"""
import builtins
import ctypes
import ctypes.util
import functools
import html
import json
import math
import numbers
import operator
import os
import subprocess
import tempfile
import threading
import time
from collections import namedtuple
from fractions import Fraction

__all__ = ["Camera", "Error", "Film", "Info", "Volume", "crc32c", "encode",
           "open"]

_I32, _U32, _U16, _I16 = (ctypes.c_int32, ctypes.c_uint32, ctypes.c_uint16,
                          ctypes.c_int16)
_SIZE, _PTR = ctypes.c_size_t, ctypes.c_void_p
_OK, _AGAIN, _ARG, _TRUNCATED, _STOPPED = 0, 1, -1, -11, -21
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
        # Names from files must not reach a terminal as they are.
        super().__init__("".join(
            c if c.isprintable() else ascii(c)[1:-1] for c in what))


# --- saga.h -----------------------------------------------------------------

class _Struct(ctypes.Structure):
    """A structure with the fields of saga.h; tests/cli/check_python.py
    compares them."""


def _ints(kind, n):
    """Returns the type of an array that refuses what it cannot hold."""
    class Ints(kind * n):
        def __setitem__(self, at, value):
            super().__setitem__(at, value)
            if self[at] != (list(value) if isinstance(at, slice) else value):
                raise OverflowError(f"an element cannot be {value}")
    return Ints


class Camera(_Struct):
    """saga_camera: a pinhole camera in the file's integers. film.camera()
    returns cameras of the rig; copy one and change its fields. Values that a
    field cannot hold are refused; ctypes alone would cut them off."""
    _fields_ = [("rotation_q30", _ints(_I32, 9)), ("centre", _ints(_I32, 3)),
                ("focal_q16", _ints(_I32, 2)),
                ("principal_q16", _ints(_I32, 2)),
                ("near_plane", _I32), ("width", _U16), ("height", _U16),
                ("background_q15", _ints(_U16, 3))]

    def __setattr__(self, name, value):
        if name not in (field[0] for field in self._fields_):
            raise AttributeError(f"a camera has no {name}")
        field = getattr(self, name)
        if isinstance(field, ctypes.Array):
            field[:] = value
            return
        super().__setattr__(name, value)
        if getattr(self, name) != value:
            raise OverflowError(f"{name} cannot be {value}")

    def copy(self):
        """Returns a camera of its own with the same values."""
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


class _Volume(_Struct):
    _fields_ = [("pivot", _I32 * 3), ("distance_min", _U32),
                ("distance_max", _U32), ("floor", _I32), ("up", _I16 * 3),
                ("front", _I16 * 3), ("azimuth", _U16), ("elevation_min", _I16),
                ("elevation_max", _I16), ("turn", _U16), ("start", _U16),
                ("quality_q8", _U16 * 2)]


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
            ("find_volume", [_PTR, _PTR, _SIZE]),
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
Volume = namedtuple("Volume", "pivot nearest farthest azimuth lowest highest "
                    "turn floor up front start psnr")
Info.__doc__ = """The properties of a film, film.info. level: of 0 to 3, what
a decoder must be able to do. fps: a Fraction. max_primitives: the most in any
segment, with its base. memory_nbytes: what the decoder takes. A position in
metres is centre_metres + metres_per_unit x in units of the box."""
Volume.__doc__ = """A sector of a ball around `pivot`, film.volume. An eye of
azimuth a, elevation e and distance d is at pivot + d (cos e (cos a front +
sin a side) + sin e up), with side = up x front. nearest, farthest: limits of
d; azimuth: the largest |a|; lowest, highest: limits of e; turn: how far the
eye may look away from the pivot; floor: its height above the pivot, or None;
start: the camera of the rig with which a player begins."""


def _in_turn(method):
    """A method of a film that waits for the film's other calls, and that a
    closed film refuses."""
    @functools.wraps(method)
    def call(self, *arguments, **options):
        with self._lock:
            if self._dec is None:
                raise Error(f"{self.info.name}: the film is closed")
            return method(self, *arguments, **options)
    return call


def _ratio(frame):
    """Returns a time in frames as a Fraction, or None if it is no time of any
    film."""
    try:
        time = Fraction(operator.index(frame))
    except TypeError:
        if not hasattr(frame, "as_integer_ratio"):
            raise TypeError(f"frame is a number, not {frame!r}") from None
        try:
            time = Fraction(*frame.as_integer_ratio())
        except (OverflowError, ValueError):  # infinite, or not a number
            return None
    if not 0 <= time < 1 << 32:
        return None
    # The decoder takes a numerator of 32 bits.
    most = (1 << 32) // (math.floor(time) + 1)
    time = time.limit_denominator(max(1, min(most, 65536)))
    return time if time < 1 << 32 else None


class Film:
    """An open file. film.info has its properties. Segments are decoded when
    they are needed. `with saga.open(file) as film` closes it at the end, which
    gives its memory back; else that happens when it is no longer used."""

    def __init__(self, name, data, seconds=None):
        if seconds is not None and (not isinstance(seconds, numbers.Real) or
                                    math.isnan(seconds)):
            raise TypeError(f"seconds is a number or None, not {seconds!r}")
        self._lock = threading.RLock()
        self._dec = None
        if not isinstance(data, bytes):
            data = memoryview(data).tobytes()
        self._data = data            # its bytes never move
        self._seconds = seconds
        # The decoder asks whether the time is over; this function must not
        # keep the film alive.
        deadline = self._deadline = [math.inf]
        self._watch = None if seconds is None else _Watch(
            _STOP(lambda _: time.monotonic() > deadline[0]))
        self._header = _Info()
        _check(_lib().saga_probe(ctypes.byref(self._header), data,
                                 len(data)), name)
        h = self._header
        # The level in the header limits the size of the work block, to at most
        # 1 GiB.
        if h.work_nbytes > _LARGEST or h.head_nbytes > len(data):
            raise Error(name + ": the file is cut short", _TRUNCATED,
                        tell=False)
        self._work = ctypes.create_string_buffer(h.work_nbytes + _ALIGN)
        at = ctypes.addressof(self._work)
        dec = _PTR()
        self._decode(name, _lib().saga_open, ctypes.byref(dec),
                     at + -at % _ALIGN, h.work_nbytes, data, len(data))
        self._dec = dec
        self._segment = None
        self.info = Info(
            name, len(data), h.version, h.level, h.n_frames, h.n_segments,
            Fraction(h.fps_num, h.fps_den), h.n_cameras, h.n_layers,
            h.base_primitives + h.max_primitives,
            h.work_nbytes, math.ldexp(h.unit_mantissa, h.unit_exponent),
            tuple(math.ldexp(m, h.centre_exponent)
                  for m in h.centre_mantissa))

    @_in_turn
    def _repr_html_(self):
        """Returns a player of the film in a frame, which a notebook shows. The
        program makes its page; without the program the film is shown as
        text."""
        with tempfile.TemporaryDirectory() as folder:
            name = os.path.basename(self.info.name) or "film"
            film = os.path.join(folder, name)
            page = film + ".html"
            with builtins.open(film, "wb") as f:
                f.write(self._data)
            try:
                done = subprocess.run(
                    [_program(), "export", film, "-o", page],
                    stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            except OSError:
                return None
            if done.returncode:
                return None
            with builtins.open(page, encoding="utf-8") as f:
                text = html.escape(f.read())
        return (f'<iframe srcdoc="{text}" allow="fullscreen; xr-spatial-'
                'tracking" style="width: 100%; aspect-ratio: 16 / 9; border: '
                '0"></iframe>')

    def close(self):
        """Gives the film's memory back. Further calls are refused."""
        with self._lock:
            self._dec = self._work = self._data = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __reduce__(self):
        # Two films would share a decoder and not know each other's segment.
        raise TypeError("a Film cannot be copied; open the file again")

    def _decode(self, what, function, *arguments):
        """Calls a function of the decoder with the film's time limit."""
        if self._watch:
            self._deadline[0] = time.monotonic() + self._seconds
        status = function(*arguments, self._watch and
                          ctypes.byref(self._watch))
        if status == _STOPPED:
            raise Error(f"{what}: decoding took more than {self._seconds:g} "
                        f"s; allow more with seconds={6 * self._seconds:g}",
                        status, tell=False)
        _check(status, what)

    def _naming(self, index):
        naming = _Naming()
        _lib().saga_name_camera(ctypes.byref(naming), self._data,
                                len(self._data), index)
        return naming

    @property
    @_in_turn
    def names(self):
        """Names of the cameras of the rig; empty if the file has none."""
        return [self._naming(i).name.decode(errors="replace")
                for i in range(self.info.n_cameras)]

    @property
    @_in_turn
    def metres(self):
        """Length of the capture's unit in metres, or 0 if the file does not
        state it."""
        naming = self._naming(0)
        return math.ldexp(naming.metre_mantissa, naming.metre_exponent)

    @property
    @_in_turn
    def volume(self):
        """From where the film looks well (docs/bitstream.md, section 13), in
        the capture's unit and in degrees, or None if the file does not say so.
        psnr has two values, at cameras that were trained on and between them.
        What is unknown is None."""
        v = _Volume()
        status = _lib().saga_find_volume(ctypes.byref(v), self._data,
                                         len(self._data))
        if status == _ARG:
            return None
        _check(status, self.info.name + ": the viewing volume")
        unit, turn = self.info.metres_per_unit, 180 / 32768
        up, front = ([x / math.hypot(*a) for x in a] for a in (v.up, v.front))
        return Volume(
            tuple(c + unit * x
                  for c, x in zip(self.info.centre_metres, v.pivot)),
            unit * v.distance_min, unit * v.distance_max, turn * v.azimuth,
            turn * v.elevation_min, turn * v.elevation_max, turn * v.turn,
            None if v.floor == -1 << 31 else unit * v.floor, tuple(up),
            tuple(front), v.start,
            tuple(q / 256 if q else None for q in v.quality_q8))

    @_in_turn
    def camera(self, index):
        """Returns a copy of camera `index` of the rig; index may be its
        name."""
        if isinstance(index, str):
            if index not in self.names:
                raise Error(f"{self.info.name}: no camera {index!r} among "
                            f"{self.names}")
            index = self.names.index(index)
        index = operator.index(index)
        camera, number = Camera(), _U32()
        if not 0 <= index < self.info.n_cameras:
            raise Error(f"{self.info.name}: no camera {index}; it has "
                        f"{self.info.n_cameras} cameras", _ARG, tell=False)
        _check(_lib().saga_rig(ctypes.byref(camera), ctypes.byref(number),
                               self._data, len(self._data), index),
               self.info.name)
        return camera

    def _seek(self, frame):
        """Decodes the segment that holds a time in frames, which may be a
        Fraction. Returns the time within the segment."""
        time = _ratio(frame)
        if time is None:
            raise Error(f"{self.info.name}: no frame {frame}; it has "
                        f"{self.info.n_frames} frames")
        s = _Segment()
        _check(_lib().saga_find(ctypes.byref(s), self._data, len(self._data),
                                time.numerator, time.denominator),
               f"{self.info.name}: frame {frame}")
        if s.number != self._segment:
            self._segment = None
            # A file that ends early may still have complete layers.
            nbytes = min(s.nbytes, len(self._data) - s.offset)
            if nbytes < s.nbytes and (self.info.n_layers == 1 or nbytes < 0):
                raise Error(self.info.name + ": the file is cut short",
                            _TRUNCATED, tell=False)
            at = ctypes.cast(self._data, _PTR).value + s.offset
            self._decode(f"{self.info.name}: segment {s.number}",
                         _lib().saga_decode, self._dec, ctypes.byref(s), at,
                         nbytes)
            self._segment = s.number
        return s.t

    @_in_turn
    def layers(self, frame=0):
        """Returns the number of complete layers in the segment of a time. This
        is info.n_layers, or fewer if the file ends early."""
        report = _Report()
        self._seek(frame)
        _check(_lib().saga_tell(ctypes.byref(report), self._dec),
               self.info.name)
        return report.n_layers

    @_in_turn
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
        numpy = _numpy()
        c = camera if isinstance(camera, Camera) else self.camera(camera)
        return numpy.frombuffer(self.pixels(c, frame), numpy.uint8).reshape(
            c.height, c.width, 3)

    @_in_turn
    def primitives(self, frame=0):
        """Returns all primitives at a time as numpy arrays: "mean" (n, 3) in
        metres, "quat" (n, 4) w, x, y, z with length 1, "scale" (n, 3)
        standard deviations in metres, "opacity" (n,)."""
        numpy = _numpy()
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
        return Film("bytes", file, seconds)
    name = os.fspath(file)
    with builtins.open(name, "rb") as f:
        return Film(name, f.read(), seconds)


def _numpy():
    try:
        import numpy
    except ImportError:
        raise Error("arrays need numpy: pip install numpy, or on Debian "
                    "python3-numpy; pixels() returns bytes without it"
                    ) from None
    return numpy


def crc32c(data):
    """Returns the CRC-32C of data, with which pictures are compared."""
    data = memoryview(data).tobytes()
    return _lib().saga_crc32c(0, data, len(data))


# What the encoder loads and runs, in Debian 12; check_python.py compares.
_PACKAGES = ("ffmpeg libgomp1 libjansson4 libopenexr-3-1-30 libpng16-16 "
             "libqrencode4 libtiff6 libturbojpeg0 libwebp7 libzstd1 zlib1g")


def _program():
    return os.environ.get("SAGA", "saga")


def encode(capture, output, **options):
    """Runs `saga encode` and returns its report. Options are those of the
    program with _ instead of -: encode(c, o, primitives=8000,
    hold_out="cam00", still=True)."""
    words = [_program(), "encode", os.fspath(capture),
             "-o", os.fspath(output), "--json"]
    for name, value in options.items():
        if value is not False and value is not None:
            words.append("--" + name.replace("_", "-"))
            if value is not True:
                words.append(str(value))
    with tempfile.TemporaryFile() as messages:
        try:
            done = subprocess.run(words, stdout=subprocess.PIPE,
                                  stderr=messages)
        except OSError as e:
            raise Error(f"{words[0]} cannot be run ({e.strerror}): this module "
                        "has no encoder. Install the program saga (`make "
                        "install` in its source, or the Debian package saga), "
                        "or name it in the environment variable SAGA"
                        ) from None
        messages.seek(0)
        said = messages.read().decode(errors="replace").strip()
    if "error while loading shared libraries" in said:
        raise Error(f"{said.splitlines()[-1]}; on Debian 12 install "
                    f"{_PACKAGES}")
    if done.returncode:
        raise Error(said.splitlines()[-1] if said else
                    f"saga encode ended with {done.returncode}")
    return json.loads(done.stdout)
