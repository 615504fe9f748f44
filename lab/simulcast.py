# SPDX-License-Identifier: MIT
"""Codes a capture's videos with a video codec, and makes a capture of the
decoded videos.

Each camera is a separate stream at a constant quality, tuned for PSNR if the
encoder supports it, with one thread, which saves bits. The pictures are
evaluated by `saga eval` like those of saga. The decoded videos take the place
of the capture's, so that both go through the same loader, which also undistorts
them.
"""
import collections
import glob
import os
import re
import shutil
import subprocess

# The most exact conversions of ffmpeg between 8-bit RGB and 4:2:0.
TO_YUV = ("scale=out_color_matrix=bt709:out_range=tv:flags=bicubic+accurate_rnd"
          "+full_chroma_int,format=yuv420p")
TO_RGB = ("scale=in_color_matrix=bt709:in_range=tv:out_range=full:flags=bicubic"
          "+accurate_rnd+full_chroma_int+full_chroma_inp,format=rgb24")

# An encoder of ffmpeg: its options, the option that sets the quality, the
# format of a raw stream, and four qualities from good to bad.
Codec = collections.namedtuple("Codec", "encoder options quality raw rates")
CODECS = {
    "x265": Codec("libx265", [
        "-preset", "medium", "-tune", "psnr", "-x265-params",
        "log-level=error:info=0:pools=none:frame-threads=1"], "-crf", "hevc",
        ["24", "30", "36", "42"]),
    "svt-av1": Codec("libsvtav1", [
        "-preset", "6", "-svtav1-params", "lp=1:tune=1"], "-crf", "obu",
        ["30", "40", "50", "60"]),
    "libaom": Codec("libaom-av1", [
        "-cpu-used", "4", "-b:v", "0", "-threads", "1"], "-crf", "obu",
        ["30", "40", "50", "60"]),
    "vvenc": Codec("libvvenc", [
        "-preset", "medium", "-threads", "1"], "-qp", "vvc",
        ["26", "32", "38", "44"]),
}


class Missing(Exception):
    """ffmpeg or the encoder is not installed."""


def ffmpeg(*words):
    # SVT-AV1 has a log of its own, which is limited to errors.
    subprocess.check_call(["ffmpeg", "-v", "error", "-nostdin", "-y"] +
                          list(words), env=dict(os.environ, SVT_LOG="1"))


def check(codec):
    try:
        encoders = subprocess.check_output(
            ["ffmpeg", "-hide_banner", "-encoders"],
            stderr=subprocess.DEVNULL, text=True)
    except (OSError, subprocess.CalledProcessError):
        encoders = ""
    if not re.search(rf"\b{re.escape(CODECS[codec].encoder)}\b", encoders):
        raise Missing("there is no ffmpeg with " + CODECS[codec].encoder)


def cameras(capture):
    """Returns (ffmpeg's input options, path in the capture) for each camera.
    The path is a video or a folder of pictures."""
    out = []
    for path in sorted(glob.glob(os.path.join(capture, "cam*.mp4")) +
                       glob.glob(os.path.join(capture, "videos", "*.mp4"))):
        out.append((["-i", path], os.path.relpath(path, capture)))
    fps = 30
    transforms = os.path.join(capture, "transforms.json")
    if os.path.exists(transforms):
        found = re.search(r'"fps": *([0-9.]+)', open(transforms).read())
        fps = found.group(1) if found else fps
    for path in sorted(glob.glob(os.path.join(capture, "images", "*", ""))):
        out.append((["-framerate", str(fps), "-pattern_type", "glob", "-i",
                     os.path.join(glob.escape(path), "*.png")],
                    os.path.relpath(path, capture)))
    return out


def decoded(folder):
    return os.path.join(folder, "decoded")


def share_rest(capture, to):
    """Links the other files of the capture: poses, points and the like."""
    for name in os.listdir(capture):
        if name in ("images", "videos", "depth") or \
                re.fullmatch(r"cam.*\.mp4", name):
            continue
        os.symlink(os.path.abspath(os.path.join(capture, name)),
                   os.path.join(to, name))


def decode_pictures(mp4, source, to):
    """Decodes into pictures with the same names as those of the capture."""
    os.makedirs(to)
    ffmpeg("-i", mp4, "-vf", TO_RGB, "-start_number", "0",
           os.path.join(to, "x%05d.png"))
    names = sorted(n for n in os.listdir(source) if n.endswith(".png"))
    made = sorted(os.listdir(to))
    if len(names) != len(made):
        raise RuntimeError(f"{mp4} has {len(made)} pictures, {source} "
                           f"{len(names)}")
    for old, new in zip(made, names):
        os.rename(os.path.join(to, old), os.path.join(to, new))


def encode(capture, codec, quality, folder, every=None):
    """Codes the capture. Returns the bytes of all raw streams; the pictures are
    in decoded(folder). `every` is the number of frames between two keyframes;
    if it is not given, the codec chooses."""
    check(codec)
    c = CODECS[codec]
    keyframes = ["-g", every, "-keyint_min", every] if every else []
    to = decoded(folder)
    shutil.rmtree(to, ignore_errors=True)
    os.makedirs(os.path.join(to, "videos"))
    share_rest(capture, to)
    nbytes = []
    for source, path in cameras(capture):
        mp4 = os.path.join(folder, "x.mp4")
        raw = os.path.join(folder, "x." + c.raw)
        ffmpeg(*source, "-an", "-vf", TO_YUV, "-colorspace", "bt709",
               "-color_range", "tv", "-c:v", c.encoder, *c.options, *keyframes,
               c.quality, quality, mp4)
        ffmpeg("-i", mp4, "-c", "copy", "-f", c.raw, raw)
        nbytes.append(os.path.getsize(raw))
        if path.endswith(".mp4"):
            os.replace(mp4, os.path.join(to, path))
        else:
            decode_pictures(mp4, os.path.join(capture, path),
                            os.path.join(to, path))
    if not nbytes:
        raise RuntimeError(f"no camera in {capture}")
    return {"bytes": sum(nbytes), "streams": len(nbytes)}
