#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_input.sh: guarantees that `saga encode` (build/saga, or SAGA=...) ends
# with status 1 if the capture is bad, or 2 if the output is, and with a message
# of one line that has the file's name, the value and, after "; ", a remedy. It
# prints nothing on stdout and leaves no incomplete file. The cases:
#   json        transforms.json is damaged, lacks keys, or has wrong types or
#               numbers that are not finite
#   cameras     poses are invalid, lenses or sizes impossible; cameras move, or
#               do not see the same region as each other or as the points
#   frames      the cameras' numbers of frames differ; pictures or points are
#               missing, empty, damaged or of an unsupported kind; times do not
#               fit
#   neu3d       videos or poses_bounds.npy are missing, damaged or do not fit
#               together
#   paths       links, and `..` and absolute paths into the capture's folder,
#               are accepted. Every loader that takes paths from a file refuses
#               other paths of pictures, videos, depths, masks and points,
#               except with --follow-paths. Folders of frames may have any name
#   output      an output that cannot be written is reported before the
#               training; if the disk fills up later, the checkpoint remains,
#               from which --resume makes the complete file, also with the
#               pictures in a scratch file. That is refused before the training
#               where it has no room, and never left behind
#   interrupt   Ctrl-C works while the capture is loaded, and if no checkpoint
#               can be written
set -u
saga=$(realpath "${SAGA:-${BUILD:-build}/saga}")
checks=input
. "$(dirname "$0")/verdict.sh"
cd "$tmp" || exit

small=(--primitives 20 --iterations 6)

# run STATUS ARGUMENTS...: checks the status of saga encode, which writes
# x.saga.
run() {
    local want=$1 rc
    shift
    "$saga" encode "$@" "${small[@]}" >out 2>err </dev/null
    rc=$?
    [ "$rc" = "$want" ] ||
        complain "saga encode $*: status $rc, not $want: $(tail -n 1 err)"
}

# says TEXT...: checks that the message is one line with a remedy and each text.
says() {
    local text
    [ "$(wc -l <err)" = 1 ] || complain "not one line of message: $(cat err)"
    for text in '; ' "$@"; do
        grep -qF -e "$text" err || complain "no '$text' in: $(cat err)"
    done
    [ ! -s out ] || complain "output beside: $(cat err)"
}

# refused CAPTURE TEXT...: checks that encode refuses the capture with these
# texts.
refused() {
    local capture=$1
    shift
    run 1 "$capture" -o x.saga
    says "$@"
    [ -z "$(ls | grep -F x.saga)" ] || complain "left behind: $(ls)"
    rm -f x.saga*
}

# A bad capture is the built-in one, changed by lines of Python: j is its
# transforms.json, b its folder, f(camera, frame) an entry; png(name, w, h) and
# write(name, data) add a file. One process makes all of them, because Python
# starts slowly.
cat >edit.py <<'PYTHON'
import glob, json, os, struct, zlib

def f(camera, frame):
    return j["frames"][3 * camera + frame]

def write(name, data):
    with open(b + "/" + name, "wb") as out:
        out.write(data)

def png(name, w, h):
    def chunk(kind, data):
        return (struct.pack(">I", len(data)) + kind + data +
                struct.pack(">I", zlib.crc32(kind + data)))
    write(name, b"\x89PNG\r\n\x1a\n" +
          chunk(b"IHDR", struct.pack(">IIBBBBB", w, h, 8, 2, 0, 0, 0)) +
          chunk(b"IDAT", zlib.compress((b"\0" + b"\0" * 3 * w) * h)) +
          chunk(b"IEND", b""))

def move_camera(camera, change):
    for frame in range(3):
        change(f(camera, frame)["transform_matrix"])

# move_points(p) replaces the points by p(x, y, z), which returns a list.
def move_points(p):
    d = open("cap/points.ply", "rb").read()
    at = d.index(b"end_header\n") + 11
    os.unlink(b + "/points.ply")
    write("points.ply", d[:at] + b"".join(
        struct.pack("<3f", *p(*struct.unpack_from("<3f", d, i))) +
        d[i + 12:i + 15] for i in range(at, len(d), 15)))

# look_apart() puts all cameras on a circle and lets them look outwards.
def look_apart():
    for camera, (x, y) in enumerate([(0, 1), (-1, 0), (0, -1), (1, 0)]):
        for frame in range(3):
            f(camera, frame)["transform_matrix"] = [
                [y, 0, -x, 5 * x], [-x, 0, -y, 5 * y], [0, 1, 0, 0],
                [0, 0, 0, 1]]

# odd_picture() gives cam01 a second picture in a file of its own, which does
# not exist.
def odd_picture():
    for names in j["train_filenames"], j["test_filenames"]:
        names[:] = [n.replace("cam01/00001", "cam01/odd") for n in names]
    f(1, 1)["file_path"] = "images/cam01/odd.png"
    os.unlink(b + "/images")
    for camera in range(4):
        os.makedirs(b + "/images/cam%02d" % camera)
        for frame in range(3):
            name = "/images/cam%02d/%05d.png" % (camera, frame)
            os.symlink("../../../cap" + name, b + name)

def picture(name):
    return bytearray(open("cap/images/" + name, "rb").read())

for name in glob.glob("code/*"):
    b = "b" + os.path.basename(name)
    j = json.load(open("cap/transforms.json"))
    os.mkdir(b)
    os.symlink("../cap/images", b + "/images")
    os.symlink("../cap/points.ply", b + "/points.ply")
    exec(open(name).read())
    write("transforms.json",
          (j if isinstance(j, str) else json.dumps(j)).encode())
    os.unlink(name)
PYTHON

# bad CODE FILE TEXT...: plans a capture that must be refused; the message must
# have the name of a file in its folder ("" for the folder) and the texts.
n=0
first=0
mkdir code
bad() {
    printf '%s\n' "$1" >"code/$n"
    shift
    printf '%s\n' "$@" >"want$n"
    n=$((n + 1))
}
bad_json() {
    local code=$1
    shift
    bad "$code" /transforms.json "$@"
}
odd() {
    local code=$1
    shift
    bad "odd_picture()
$code" /images/cam01/odd.png "$@"
}
# try_all: makes and tries the captures that were planned since the last call.
try_all() {
    local text
    python3 edit.py 2>>bad || complain "edit.py failed"
    while [ $first -lt $n ]; do
        mapfile -t text <"want$first"
        refused "b$first" "b$first${text[0]}: " "${text[@]:1}"
        rm -rf "b$first" "want$first"
        first=$((first + 1))
    done
}

"$saga" synth cap --size 64x36 --cameras 4 --hold-out 1 --frames 3 \
    --points 300 --depth-every 0 >out 2>err || complain "synth: $(cat err)"

# ---- json
bad_json 'j = ""' 'not valid JSON at line 1'
bad_json 'j = json.dumps(j)[:-40]' 'not valid JSON at line 1'
bad_json 'j = "\0\1\2"' 'not valid JSON'
bad_json 'j = "[" * 5000' 'not valid JSON'
bad_json 'j = []' '(root)' 'is not an object'
bad_json 'del j["frames"]' '"frames"' missing
bad_json 'j["frames"] = {}' '"frames"' 'is an object, expected an array'
bad_json 'j["frames"] = []' '"frames" has 0 entries'
bad_json 'j["frames"][4] = 7' 'frames[]' 'a number, expected an object'
bad_json 'del f(1, 1)["file_path"]' '"file_path" in frames[4] is missing'
bad_json 'f(1, 1)["file_path"] = 5' '"file_path" in frames[4] is a number'
bad_json 'del f(1, 2)["transform_matrix"]' \
    '"transform_matrix" in frames[5] is missing'
bad_json 'f(1, 2)["transform_matrix"][1].pop()' \
    '"transform_matrix" in frames[5]'
bad_json 'f(1, 2)["transform_matrix"][1][0] = "0"' 'is "0", expected'
bad_json 'f(1, 2)["transform_matrix"][3][0] = 1' 'frames[5] is not 0 0 0 1'
bad_json 'f(0, 1)["transform_matrix"][0][3] = float("nan")' \
    '"transform_matrix" in frames[1] is "NaN", expected 4 rows'
bad_json 'f(0, 1)["transform_matrix"][0][3] = float("inf")' \
    '"transform_matrix" in frames[1] is "Infinity"'
bad_json 'f(0, 1)["transform_matrix"][0][3] = float("-inf")' \
    '"transform_matrix" in frames[1] is "-Infinity"'
bad_json 'j["k1"] = "@"
j = json.dumps(j).replace("\"@\"", "-nan(ind)")' '"k1" at the top is "-nan(ind)"'
bad_json 'j = json.dumps(j).replace("57.6", "1e999", 1)' 'not finite at line 1'
bad_json 'j["fl_x"] = "57.6"' '"fl_x" at the top is "57.6"'
bad_json 'del j["fl_x"]' 'focal length of images/cam00/00000.png is missing'
bad_json 'j["fps"] = 0' '"fps" is 0'
bad_json 'j["fps"] = -24' '"fps" is -24'
bad_json 'j["train_filenames"] = 3' '"train_filenames" at the top is a number'
bad_json 'j["train_filenames"][2] = None' 'is null'
bad_json 'j["train_filenames"][2] = "images/nobody.png"' 'nobody.png'
bad_json 'j["test_filenames"].append("cam01")' 'lists "cam01"'
try_all
verdict json

# ---- cameras
bad_json 'j["w"] = -64' 'is -64 x 36, the file has 64 x 36 pixels'
bad_json 'j["h"] = 72' 'is 64 x 72, the file has 64 x 36 pixels'
bad_json 'j["camera_model"] = "FOV"' '"FOV" of frames[0]'
bad_json 'j["k4"] = 0.5' 'k4 = 0.5 of frames[0]'
bad_json 'move_camera(1, lambda m: m[0].__setitem__(0, 3))' \
    'images/cam01/00000.png (frames[3])' 'first row 3'
bad 'move_camera(1, lambda m: [r.__setitem__(0, -r[0]) for r in m[:3]])' \
    '' cam01 'mirror images'
bad_json 'f(1, 1)["transform_matrix"][0][3] += 1' 'unequal frame counts'
bad 'j["fl_x"] = -57.6' /images/cam00/00000.png 'fx -57.6'
bad 'j["fl_y"] = 0' /images/cam00/00000.png 'fy 0'
bad 'j["k1"] = -90' /images/cam00/00000.png 'k1 -90' 'folds the picture'
bad 'look_apart()' '' 'no overlap: only' 'inside two or more of the 4 cameras'
bad 'look_apart()
del j["ply_file_path"]' '' 'no overlap: no two of the 4 cameras'
bad 'for c in range(4):
    move_camera(c, lambda m: [r.__setitem__(k, -r[k]) for r in m[:3]
                              for k in (1, 2)])' \
    '' 'no overlap' 'negate columns 1 and 2'
bad 'move_points(lambda x, y, z: (x + 900, y, z))' \
    '' 'no overlap: only 0 of 300 points'
bad_json 'j["train_filenames"].pop()' 'only some pictures of camera cam03'
try_all
run 1 cap -o x.saga --hold-out cam00,cam01,cam02,cam03
says cap: 'all 4 cameras are held out'
verdict cameras

# ---- frames
bad_json 'del j["frames"][10:]' 'images/cam00/00000.png has 3' \
    'images/cam03/00000.png has 1'
bad_json 'del f(1, 1)["time"]' 'only 11 of 12 frames have "time"'
bad_json 'f(1, 1)["time"] = 0' 'have one pose and one time 0'
bad_json 'f(1, 1)["time"] = 0.06' 'time 0.06 of images/cam01/00001.png'
bad_json 'for c in range(4):
    f(c, 2)["time"] += 1' 'is not near'
bad_json 'f(2, 0)["file_path"] = "a.mp4"' 'mixes 1 videos and 11 pictures'
bad 'os.unlink(b + "/images")' '' 'none of its 4 cameras has a picture'
odd 'png("images/cam01/odd.png", 48, 36)' \
    'is 48 x 36 pixels, expected 64 x 36'
odd 'png("images/cam01/odd.png", 0, 0)' 'size of 0 x 0 pixels'
odd 'png("images/cam01/odd.png", 64, 0)' 'size of 64 x 0 pixels'
odd 'png("images/cam01/odd.png", 64, 20000)' 'size of 64 x 20000 pixels'
odd 'write("images/cam01/odd.png", b"")' 'not a PNG, JPEG, WebP, TIFF or OpenEXR' \
    '0 bytes read'
odd 'write("images/cam01/odd.png", b"GIF89a, not a PNG")' \
    'starts with 47 49 46 38'
odd 'write("images/cam01/odd.png", picture("cam01/00001.png")[:900])' \
    'damaged or cut short'
odd 'd = picture("cam01/00001.png")
d[600] ^= 8
write("images/cam01/odd.png", d)' 'damaged or cut short'
bad 'os.unlink(b + "/points.ply")' /points.ply 'cannot be opened'
bad 'd = open("cap/points.ply", "rb").read()
os.unlink(b + "/points.ply")
write("points.ply", d[:-7])' /points.ply \
    'announces 300 points but has only 4493 bytes'
try_all
# Cameras that lack a picture must be accepted: it is not listed, its file is
# missing, or its path is a folder.
cat >code/holes <<'PYTHON'
odd_picture()
os.mkdir(b + "/images/cam01/odd.png")
f(2, 1)["file_path"] = "images/cam02/1.png"
for names in j["train_filenames"], j["test_filenames"]:
    names[:] = [n.replace("cam02/00001", "cam02/1").replace(
        "cam03/00002", "cam03/00001") for n in names]
j["frames"].pop()
PYTHON
python3 edit.py 2>>bad || complain "edit.py failed"
run 0 bholes -o x.saga
grep -q 'pictures: 3 are missing' err || complain "missing: $(cat err)"
rm -f x.saga
run 1 cap -o x.saga --scale 1/40
says cap/images/cam00/00000.png: '64 x 36 pixels leave nothing'
run 2 cap -o x.saga --scale 1/5
says 'view cam00 is 12 x 7 pixels'
verdict frames

# ---- neu3d
# poses NAME CODE [NBYTES]: p/NAME, a poses_bounds.npy of two cameras, its rows
# changed by Python, of which NBYTES are kept.
cat >poses.py <<'PYTHON'
import glob, os, struct
for name in glob.glob("code/*"):
    rows = []
    for camera in range(2):
        r = [[0, 1, 0, camera / 4, 48], [-1, 0, 0, 0, 64], [0, 0, 1, 0, 60]]
        rows += [x for line in r for x in line] + [1, 9]
    nbytes = 9999
    exec(open(name).read())
    head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (2, 17), }"
    data = b"\x93NUMPY\1\0" + struct.pack("<H", len(head)) + head
    data += struct.pack("<34d", *rows)
    open("p/" + os.path.basename(name), "wb").write(data[:nbytes])
    os.unlink(name)
PYTHON
mkdir p
echo 'pass' >code/good
echo 'rows[0] = float("nan")' >code/nan
echo 'rows[20] = float("inf")' >code/inf
echo 'rows[31] = -60' >code/focal
echo 'nbytes = 40' >code/head
echo 'nbytes = 200' >code/cut
# The second camera looks in the opposite direction.
echo 'for i in 0, 1, 2:
    rows[17 + 5 * i + 1] *= -1
    rows[17 + 5 * i + 2] *= -1' >code/apart
python3 poses.py 2>>bad || complain "poses.py failed"
echo 1 >p/text
poses() { cp "p/$1" n/poses_bounds.npy; }
# video NAME FRAMES: writes a video.
video() {
    ffmpeg -nostdin -v error -f lavfi -i "testsrc=s=64x48:r=25,trim=end_frame=$2" \
        -c:v libx264 -y "n/$1" 2>>bad
}
mkdir n
video cam00.mp4 3
refused n n: '1 videos but no calibration' docs/from-cameras.md
poses good
refused n n/poses_bounds.npy '2 rows but there are 1 videos'
cp n/cam00.mp4 n/cam01.mp4
run 0 n -o x.saga --hold-out cam00
rm -f x.saga
poses nan
refused n n/poses_bounds.npy 'row of cam00 is not finite' 'nan'
poses inf
refused n n/poses_bounds.npy 'row of cam01 is not finite'
poses focal
refused n n/poses_bounds.npy 'row of cam01 has' 'focal length -60'
poses head
refused n n/poses_bounds.npy 'its header is cut short'
poses cut
refused n n/poses_bounds.npy 'announces 2 x 17 numbers of 8 bytes but holds'
poses text
refused n n/poses_bounds.npy 'is not an .npy file'
poses apart
refused n n: 'no overlap'
poses good
video cam01.mp4 5
refused n n/cam00.mp4 'cam00 has 3 frames, cam01 has 5' '--frames 0:3'
head -c 1000 n/cam00.mp4 >n/cam01.mp4
refused n n/cam01.mp4 'not a video that ffprobe can read'
rm n/cam01.mp4
refused n n/poses_bounds.npy '2 rows but there are 1 videos'
mkdir empty
refused empty empty 'no capture of a known format'
refused nowhere nowhere 'does not exist'
(PATH=/nonexistent; run 1 n -o x.saga)
says ffprobe 'install ffmpeg'
verdict neu3d

# ---- paths
outside="which is not in the capture's folder"
lists='del j["train_filenames"]
del j["test_filenames"]
'
absolute='for x in j["frames"]:
    x["file_path"] = os.path.abspath(b + "/" + x["file_path"])
'
# The pictures are reached through a link, through `..` that returns to the
# folder, and by an absolute path; one picture does not exist.
printf '%s\n' "$lists$absolute" 'f(1, 1)["file_path"] = "images/cam01/no.png"
f(0, 1)["file_path"] = "../" + b + "/images/cam00/00001.png"
f(0, 2)["file_path"] = "images/../images/cam00/00002.png"
f(2, 1)["file_path"] = os.path.abspath(b + "/images/cam02/no.png")
j["ply_file_path"] = os.path.abspath(b + "/../" + b + "/points.ply")' >code/fine
printf '%s\n' "$lists" 'for x in j["frames"]:
    x["file_path"] = os.path.abspath("cap/" + x["file_path"])
j["ply_file_path"] = "../cap/../cap/points.ply"' >code/far
python3 edit.py 2>>bad
# If images is a link out of the folder, images/.. is another folder.
run 1 bfine -o x.saga
says '"images/../images/cam00/00002.png"' "$outside"
rm bfine/images
cp -r cap/images bfine
ln -s bfine linked
for path in bfine linked linked/transforms.json "$PWD/bfine"; do
    run 0 "$path" -o x.saga
    grep -q 'pictures: 2 are missing' err || complain "$path: $(cat err)"
    [ -f x.saga ] || complain "$path: no file: $(cat err)"
    rm -f x.saga
done
(cd bfine && run 0 transforms.json -o x.saga; rm -f x.saga)
refused bfar bfar/transforms.json "names \"$PWD/cap/images" "$outside"
run 0 bfar -o x.saga --follow-paths
[ -f x.saga ] || complain "no file: $(cat err)"
rm -f x.saga
for path in ../cap/points.ply /etc/passwd images/../../cap/points.ply .. \
    ../bnone/../cap/points.ply; do
    bad_json "j['ply_file_path'] = '$path'" "\"$path\"" "$outside"
done
bad_json 'f(1, 1)["file_path"] = "../cap/images/cam01/00001.png"
del j["train_filenames"]
del j["test_filenames"]' '"../cap/images/cam01/00001.png"' "$outside"
bad_json 'f(1, 1)["mask_path"] = "../cap/images/cam01/00001.png"' "$outside"
bad_json 'f(1, 1)["depth_file_path"] = "/tmp/x.exr"' '"/tmp/x.exr"' "$outside"
bad_json 'del j["train_filenames"]
del j["test_filenames"]
j["frames"] = [dict(f(c, 0), file_path="/n/cam%02d.mp4" % c) for c in range(4)]
for x in j["frames"]:
    del x["time"]' '"/n/cam00.mp4"' "$outside"
try_all
# These are the layouts of Blender, COLMAP, Panoptic Sports and frame folders.
# MIV and Neu3D read only names in their own folder.
cat >layouts.py <<'PYTHON'
import json, os
j = json.load(open("cap/transforms.json"))
del j["train_filenames"], j["test_filenames"]
first = [j["frames"][3 * c] for c in range(4)]

def put(name, text):
    os.makedirs(os.path.dirname(name), exist_ok=True)
    with open(name, "w") as out:
        out.write(text)

def angles(entries):
    return json.dumps({"camera_angle_x": 1.0, "frames": entries})

out = "../cap/images/cam0%d/00000.png"
put("blender/transforms_train.json", angles(
    [dict(e, file_path=out % c) for c, e in enumerate(first)]))
images = "".join("%d 1 0 0 0 %d 0 0 1 %s\n\n" % (
    c + 1, -c, out.replace("../", "../../") % c) for c in range(4))
put("colmap/sparse/0/cameras.txt", "1 PINHOLE 64 36 57 57 32 18\n")
put("colmap/sparse/0/images.txt", images)
put("colmap/sparse/0/points3D.txt", "")
os.mkdir("colmap/images")
k = [[57, 0, 32], [0, 57, 18], [0, 0, 1]]
eye = [[float(r == c) for c in range(4)] for r in range(4)]
def w2c(c):
    return [[*row[:3], -float(c) if r == 0 else row[3]]
            for r, row in enumerate(eye)]
os.makedirs("sports/ims")
put("sports/train_meta.json", json.dumps({
    "w": 64, "h": 36, "k": [[k] * 4], "w2c": [[w2c(c) for c in range(4)]],
    "fn": [[out.replace("../", "../../") % c for c in range(4)]],
    "cam_id": [[0, 1, 2, 3]]}))
for t in range(2):
    put("times/frame%d/transforms.json" % t, json.dumps(dict(
        j, frames=[dict(e, file_path=os.path.abspath(
            "cap/images/cam0%d/0000%d.png" % (c, t))) for c, e in
            enumerate(first)], ply_file_path="../../cap/points.ply")))
PYTHON
python3 layouts.py 2>>bad || complain "layouts.py failed: $(cat bad)"
refused blender blender/transforms_train.json '"../cap/images/cam00' "$outside"
refused colmap colmap/sparse/0 '"../../cap/images/cam00' "$outside"
refused sports sports/train_meta.json '"../../cap/images/cam00' "$outside"
refused times times/frame0/transforms.json "\"$PWD/cap/images" "$outside"
for path in blender colmap sports; do
    run 0 $path -o x.saga --hold-out '' --follow-paths
    [ -f x.saga ] || complain "$path: no file: $(cat err)"
    rm -f x.saga
done
# With paths out of a frame's folder, all frame folders would have the same
# pictures, or none.
run 1 times -o x.saga --follow-paths
says "$PWD/cap/images/cam00/00000.png" 'does not lie in times/frame0'
# A COLMAP model lies next to frame folders, and points lie in the folder above
# a frame's.
for t in 0 1; do
    mkdir -p "beside/frame$t" "above/frame$t"
    for c in 0 1 2 3; do
        cp "cap/images/cam0$c/0000$t.png" "beside/frame$t/cam0$c.png"
        cp "cap/images/cam0$c/0000$t.png" "above/frame$t/cam0$c.png"
    done
    sed 's|"[^"]*/\(cam0.\)/0000..png"|"\1.png"|g; s|"../../cap/|"../|' \
        times/frame$t/transforms.json >above/frame$t/transforms.json
done
cp cap/points.ply above
mkdir -p beside/sparse/0
cp colmap/sparse/0/* beside/sparse/0
sed -i 's|[^ ]*/\(cam0.\)/00000.png|\1.png|' beside/sparse/0/images.txt
for path in beside above; do
    run 0 $path -o x.saga --hold-out ''
    grep -q 'frames: 2 folders' err || complain "$path: $(cat err)"
    rm -f x.saga
done
verdict paths

# ---- output
bad_output() {
    run 2 cap -o "$1"
    says "$1"
}
touch plain
bad_output plain/x.saga
bad_output nowhere/x.saga
bad_output cap
bad_output /dev/full
bad_output /proc/x.saga
bad_output "$(printf '%0300d' 0).saga"
run 1 cap -o x.saga --scratch nowhere
says nowhere 'no scratch file can be made' --scratch
(ulimit -f 1; "$saga" encode cap -o x.saga --scratch . >out 2>err </dev/null)
[ $? = 1 ] || complain "full disk, scratch file: $(cat err)"
grep -q 'no room for a scratch file .*(File too large; .* GB are free); ' err ||
    complain "full disk, scratch file: $(cat err)"
[ ! -e x.saga ] || complain "an output without a scratch file"
long=(--primitives 150 --iterations 1200)
# stop PID: sends Ctrl-C once the first checkpoint exists.
stop() {
    local i=0
    while [ ! -f d/x.saga.ckpt ] && [ $i -lt 500 ]; do
        sleep 0.02
        i=$((i + 1))
    done
    kill -INT "$1"
    wait "$1"
    [ $? = 2 ] || complain "Ctrl-C: $(cat err)"
}
mkdir d
set -m
$stoppable "$saga" encode cap -o d/x.saga "${long[@]}" --checkpoint-every 0 \
    >out 2>err </dev/null &
stop $!
set +m
cp d/x.saga.ckpt was
# No file may be longer than 2 blocks, so that the write fails as on a full
# disk.
(trap '' XFSZ; ulimit -f 2
 "$saga" encode cap -o d/x.saga "${long[@]}" --resume 2>err | cat >out
 exit "${PIPESTATUS[0]}")
[ $? = 2 ] || complain "full disk: $(cat err)"
grep -q 'the checkpoint was not written: .*d/x.saga.ckpt: could not be written' err ||
    complain "full disk, checkpoint: $(cat err)"
tail -n 1 err | grep -q 'd/x.saga: could not be written (File too large); .*free space.*--resume' ||
    complain "full disk, file: $(tail -n 1 err)"
[ "$(ls d | xargs)" = 'x.saga.ckpt x.saga.ckpt.csv' ] ||
    complain "full disk leaves $(ls d)"
cmp -s was d/x.saga.ckpt || complain "full disk: another checkpoint"
"$saga" encode cap -o d/x.saga "${long[@]}" --resume --scratch d \
    >out 2>err </dev/null || complain "resumed: $(tail -n 1 err)"
"$saga" encode cap -o whole.saga "${long[@]}" >out 2>err </dev/null
cmp -s d/x.saga whole.saga || complain "resumed to another file"
[ "$(ls d)" = x.saga ] || complain "in the end: $(ls d)"
rm -rf d whole.saga was
verdict output

# ---- interrupt
set -m
# Ctrl-C arrives while ffmpeg decodes, which receives it as well.
video cam01.mp4 3
mkdir bin
printf '#!/bin/sh\n: >%s/decoding\nexec sleep 30\n' "$tmp" >bin/ffmpeg
chmod +x bin/ffmpeg
PATH=$tmp/bin:$PATH $stoppable "$saga" encode n -o x.saga >out 2>err \
    </dev/null &
pid=$!
i=0
while [ ! -f decoding ] && [ $i -lt 500 ]; do
    sleep 0.02
    i=$((i + 1))
done
kill -INT -- "-$pid"
wait "$pid"
[ $? = 2 ] || complain "Ctrl-C while loading: $(cat err)"
says 'stopped while loading' 'nothing was written'
[ -z "$(ls | grep -F x.saga)" ] || complain "left behind: $(ls)"
# The checkpoint cannot be written, because a folder has its name.
mkdir -p d/x.saga.ckpt
$stoppable "$saga" encode cap -o d/x.saga "${long[@]}" --checkpoint-every 0 \
    >out 2>err </dev/null &
pid=$!
i=0
while ! grep -q 'checkpoint was not written' err && [ $i -lt 500 ]; do
    sleep 0.02
    i=$((i + 1))
done
kill -INT "$pid"
wait "$pid"
[ $? = 2 ] || complain "Ctrl-C without a checkpoint: $(cat err)"
tail -n 1 err | grep -q 'the training is lost, since no checkpoint could be written' ||
    complain "Ctrl-C without a checkpoint: $(tail -n 1 err)"
[ "$(ls d)" = x.saga.ckpt ] || complain "Ctrl-C leaves $(ls d)"
set +m
verdict interrupt

all_passed
