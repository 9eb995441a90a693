#!/usr/bin/env bash
# Sound files for the fuzzer to begin with, most of them written by the program itself: tests/fuzz/seeds/TARGET/.
# A zero byte before a file is the choice that some targets take from the first.
set -euo pipefail
cd "$(dirname "$0")/../.."
corpus=$PWD/tests/fuzz/seeds
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
cargo build --release --quiet
program() { "${CARGO_TARGET_DIR:-target}/release/tunnelstitch" "$@" --quiet >"$work/said"; }
# seed TARGET NAME [CHOICE]: standard input becomes a seed.
seed() {
    mkdir -p "$corpus/$1"
    { [ $# -lt 3 ] || printf "\\$3"; cat; } >"$corpus/$1/$2"
}

blender=fixtures/blender_free48
for choice in 0 1 2 3; do
    seed calibration "own-$choice" "$choice" <$blender/camera.json
    printf '0 0 0\n0 5 0 3\n1 10 0\n3 15 0 # bend\n' | seed centreline "points-$choice" "$choice"
done
seed discovery camera 0 <$blender/camera.json
seed discovery poses 3 <$blender/baseline.tum
seed poses tum 0 <$blender/baseline.tum
for name in zstd unchunked ros1 transforms; do
    seed recordings "$name.mcap" 0 <"fixtures/recordings/$name.mcap"
done
for name in plain bz2; do
    seed recordings "$name.bag" 1 <"fixtures/recordings/$name.bag"
done

# The survey that the targets simulate, and what the program makes of it.
small=$work/small
program simulate free --frames 4 --size 32x24 --supersample 1 --out "$small"
seed survey small <"$small/survey.toml"
program config "$small" --json
program init "$work/small" --radius-m 3 --force
seed survey init <"$small/survey.toml"
seed survey everything <<'END'
[tunnel]
shape = "ellipse"
width_m = 6.0
height_m = 6.5
centreline = "curve.txt"
ignore = [{ theta_deg = [150, 210], chainage_m = [2.0, 5.5] }, { theta_deg = [330, 30] }]
[camera]
file = "camera.json"
readout_ms = 20.0
[frames]
images = "frames/*.png"
times = "times.txt"
mask = "mask.png"
[poses]
initial = "baseline.tum"
truth = "groundtruth.tum"
convention = "c2w"
camera_axes = "opencv"
body_to_camera = "body.yaml"
tunnel_frame = "axis.json"
associate = "time"
time_tolerance_s = 0.01
interpolate = true
[prior]
model = "independent"
rotation_sigma_deg = 2.0
translation_sigma_m = [0.02, 0.02, 0.03]
[calibrate]
unknowns = ["focal", "centre", "distortion"]
focal_sigma_percent = 2.0
[options.stitch]
mode = "average"
END
seed poses small 0 <"$small/baseline.tum"
for format in kitti csv nerfstudio; do
    program convert "$small" --to $format --out "$work/poses.$format"
    seed poses $format 0 <"$work/poses.$format"
done
program convert "$small" --to colmap --out "$work/colmap"
seed poses colmap 0 <"$work/colmap/images.txt"
seed calibration colmap 3 <"$work/colmap/cameras.txt"
seed calibration nerfstudio 0 <"$work/poses.nerfstudio"
program refine "$small" --out "$work/refined" --calibrate focal
seed refinement refined <"$work/refined/refine.json"
{ cat "$work/refined/refine.json"; printf '\0'; cat "$work/refined/covariance.csv"; } | seed refinement both
head -4 "$work/refined/covariance.csv" | seed covariances frames
program converge --rotation-deg 2 --jitter independent --seeds 1 --frames 2 --size 32x24 --noise 0 --out "$work/sweep"
sed 's/"noise_grey":0.0/"noise_grey":-1.0/' "$work/sweep/runs.jsonl" | seed sweep runs
for ending in png jpg tif; do
    program stitch "$small" --px-per-metre 5 --out "$work/wall.$ending"
    seed pictures $ending <"$work/wall.$ending"
done

seed poses euroc 0 <<'END'
#timestamp [ns],p_x,p_y,p_z,q_w,q_x,q_y,q_z
1000000000,0,0,0,1,0,0,0
1100000000,0,0,0,1,0,0,0
END
seed calibration opencv 2 <<'END'
%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [415., 0., 318., 0., 417., 241., 0., 0., 1.]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [-0.3, 0.1, 0.001, -0.002, -0.02]
END
kalibr='cam0:
  camera_model: pinhole
  distortion_coeffs: [-0.3, 0.1, 0.001, -0.002]
  distortion_model: equidistant
  intrinsics: [415, 417, 318, 241]
  resolution: [640, 480]
  T_cam_imu:
  - [1, 0, 0, 0]
  - [0, 1, 0, 0]
  - [0, 0, 1, 0]
  - [0, 0, 0, 1]'
seed calibration kalibr 2 <<<"$kalibr"
seed frames_of_reference kalibr <<<"$kalibr"
seed calibration ros 2 <<'END'
image_width: 640
image_height: 480
camera_name: narrow
camera_matrix: {rows: 3, cols: 3, data: [415, 0, 318, 0, 417, 241, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.3, 0.1, 0.001, -0.002, 0]}
END
seed calibration camodocal 2 <<'END'
%YAML:1.0
---
model_type: MEI
camera_name: camera
image_width: 640
image_height: 480
mirror_parameters:
   xi: 1.5
distortion_parameters:
   k1: -0.1
   k2: 0.01
   p1: 0.001
   p2: 0.0
projection_parameters:
   gamma1: 815.
   gamma2: 817.
   u0: 318.
   v0: 241.
END
seed calibration basalt 0 <<<'{"value0": {"intrinsics": [{"camera_type": "ds", "intrinsics": {"fx": 157, "fy": 157, "cx": 255, "cy": 256, "xi": -0.18, "alpha": 0.59}}], "resolution": [[512, 512]]}}'
seed calibration ocamcalib 3 <<<$'#polynomial coefficients\n5 -200 0 0.002 -0.000003 0.00000002\n\n#polynomial coefficients for the inverse mapping function\n4 300 180 -10 15\n\n#center\n240 320\n\n#affine parameters\n1 0 0\n\n#image size\n480 640'
seed calibration gyroflow 0 <<'END'
{"calib_dimension": {"w": 640, "h": 480}, "frame_readout_time": 15.5, "distortion_model": null, "digital_lens": null,
 "input_horizontal_stretch": 1.0, "crop": null, "fisheye_params": {"camera_matrix": [[415, 0, 318], [0, 417, 241], [0, 0, 1]],
 "distortion_coeffs": [-0.01, 0.005, -0.004, 0.0007]}}
END
seed calibration angles 0 <<<'{"camera_angle_x": 1.25, "w": 640, "h": 480, "frames": []}'
opensfm='[{"cameras": {"v2": {"projection_type": "brown", "width": 640, "height": 480, "focal_x": 0.65, "focal_y": 0.65, "c_x": 0.01,
 "c_y": 0, "k1": -0.1, "k2": 0.01, "k3": 0, "p1": 0.001, "p2": 0}}, "shots": {"a.png": {"rotation": [0.1, 0.2, 0.3],
 "translation": [1, 2, 3], "camera": "v2"}}, "points": {}}]'
seed poses opensfm 0 <<<"$opensfm"
seed calibration opensfm 0 <<<"$opensfm"
bundler=$(cat <<'END'
# Bundle file v0.3
2 1
500 -0.1 0.01
1 0 0
0 1 0
0 0 1
-1 -2 -3
0 0 0
0 0 0
0 0 0
0 0 0
0 0 0
1.5 2.5 3.5
255 0 0
1 0 7 12.5 -3.25
END
)
seed poses bundler 0 <<<"$bundler"
seed calibration bundler 6 <<<"$bundler"
meshroom='{"version": ["1", "2", "6"], "views": [{"viewId": "1", "poseId": "2", "intrinsicId": "3", "path": "a.png"}],
 "intrinsics": [{"intrinsicId": "3", "width": "640", "height": "480", "sensorWidth": "36", "type": "radial3", "focalLength": "24",
 "pixelRatio": "1", "principalPoint": ["-2", "1"], "distortionParams": ["-0.1", "0.01", "0"]}], "poses": [{"poseId": "2",
 "pose": {"transform": {"rotation": ["0", "0", "1", "-1", "0", "0", "0", "-1", "0"], "center": ["1", "2", "3"]}, "locked": "0"}}]}'
seed poses meshroom 0 <<<"$meshroom"
seed calibration meshroom 0 <<<"$meshroom"
openmvg='{"sfm_data_version": "0.3", "root_path": "", "views": [{"key": 0, "value": {"ptr_wrapper": {"data": {"local_path": "", "filename":
 "a.png", "width": 640, "height": 480, "id_view": 0, "id_intrinsic": 4, "id_pose": 5}}}}], "intrinsics": [{"key": 4, "value":
 {"polymorphic_name": "pinhole_radial_k3", "ptr_wrapper": {"data": {"width": 640, "height": 480, "focal_length": 415,
 "principal_point": [318, 241], "disto_k3": [-0.1, 0.01, 0]}}}}], "extrinsics": [{"key": 5, "value": {"rotation":
 [[0, -1, 0], [0, 0, -1], [1, 0, 0]], "center": [1, 2, 3]}}]}'
seed poses openmvg 0 <<<"$openmvg"
seed calibration openmvg 0 <<<"$openmvg"
metashape='<document version="2.0.0"><chunk><sensors><sensor id="0" type="frame"><calibration type="frame" class="adjusted">
<resolution width="640" height="480"/><f>415</f><cx>-2</cx><cy>1</cy><k1>-0.1</k1></calibration></sensor></sensors><cameras>
<camera id="0" sensor_id="0" component_id="0" label="a"><transform>0 0 1 1 -1 0 0 2 0 -1 0 3 0 0 0 1</transform></camera></cameras>
<transform><rotation>0 -1 0 1 0 0 0 0 1</rotation><translation>10 0 0</translation><scale>2</scale></transform></chunk></document>'
seed poses metashape 0 <<<"$metashape"
seed calibration metashape 5 <<<"$metashape"
seed calibration realitycapture 7 <<<$'#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\na.png,1,2,3,10,90,-5,35,0.01,-0.02,-0.1,0.01,0,0,0.001,0'
pix4d=$'fileName imageWidth imageHeight\ncamera model m = K [R|-Rt] X\n\na.png 640 480\n415 0 318\n0 415 241\n0 0 1\n-0.1 0.01 0\n0.001 0\n1 2 3\n1 0 0\n0 1 0\n0 0 1'
seed calibration pix4d 3 <<<"$pix4d"
seed calibration pix4d-cam 10 <<<$'Pix4D camera calibration file 0\n#Focal Length mm assuming a sensor width of 6.4x4.8mm\nF 4.15\nPx 3.18\nPy 2.41\nK1 -0.1\nK2 0.01\nK3 0\nT1 0.001\nT2 0'
seed poses realitycapture 0 <<<$'#name,x,y,alt,heading,pitch,roll,f\na.png,1,2,3,10,90,-5,35'
seed poses pix4d 0 <<<$'imageName X Y Z Omega Phi Kappa\na.png 1 2 3 90 10 -5'
seed gyro colon 0 <<<$'GYROFLOW IMU LOG\nversion:1.1\norientation,YxZ\ntscale,0.1\ngscale,0.01\nt,gx,gy,gz\n0,1,2,3\n1,2,3,4\n2,3,4,5\n9,4,5,6'
# The MP4 of a GoPro: three payloads of four rates and two accelerations, a second each. All in hexadecimal digits.
mp4_box() { printf '%08x%s%s' $((8 + ${#2} / 2)) "$(printf %s "$1" | od -An -v -tx1 | tr -d ' \n')" "$2"; }
# klv KEY TYPE BYTES-OF-AN-ELEMENT ELEMENTS DIGITS
klv() { printf '%s%s%02x%04x%s' "$(printf %s "$1" | od -An -v -tx1 | tr -d ' \n')" "$2" "$3" "$4" "$5"; }
device=$(klv STRM 00 1 36 "$(klv SCAL 73 2 1 00640000)$(klv ACCL 73 6 2 03d500000000000003d60001)")
device+=$(klv STRM 00 1 64 "$(klv ORIN 63 1 3 5a585900)$(klv SCAL 73 2 1 03e80000)$(klv GYRO 73 6 4 000100020003000200030004000300040005000400050006)")
payload=$(klv DEVC 00 1 $((${#device} / 2)) "$device")
bytes=$(printf %08x $((${#payload} / 2)))
table=$(mp4_box stsd 00000000000000010000001067706d640000000000000001)
table+=$(mp4_box stts 000000000000000100000003000003e8)
table+=$(mp4_box stsc 0000000000000001000000010000000300000001)
table+=$(mp4_box stsz "0000000000000000""00000003$bytes$bytes$bytes")
table+=$(mp4_box stco 000000000000000100000014)
media=$(mp4_box mdhd 000000000000000000000000000003e800000bb800000000)$(mp4_box minf "$(mp4_box stbl "$table")")
gopro=$(mp4_box ftyp 6d703431)$(mp4_box mdat "$payload$payload$payload")$(mp4_box moov "$(mp4_box trak "$(mp4_box mdia "$media")")")
for choice in 7 20 37; do
    printf "$(sed 's/../\\x&/g' <<<"$gopro")" | seed gyro "gopro-$choice" "$(printf '%o' $choice)"
done
seed frames_of_reference axis <<<'{"point_m": [0, 0, 0], "axis": [1, 0, 0], "theta_zero": [0, 0, 1]}'
seed frames_of_reference matrix <<<'1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1'
seed frames_of_reference euroc <<<'T_BS: {rows: 4, cols: 4, data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}'
printf '1 2 CAMERA 1 CAMERA 2 1 0.6 0 0.8 0 0.5 -1 2.25\n' | seed frames_of_reference rigs
{
    printf '\1\0\0\0\0\0\0\0\1\0\0\0\2\0\0\0\0\0\0\0\1\0\0\0\0\0\0\0\2\0\0\0\1'
    printf '\0\0\0\0\0\0\360\77'
    head -c 48 /dev/zero
} | seed frames_of_reference rigs-binary
seed points ply 0 <<<$'ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n4 5 6'
seed points pcd 1 <<<$'VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n1 2 3\n4 5 6'
seed points xyz 2 <<<$'x y z\n1 2 3\n4 5 6'
# LAS 1.2 with a point of format 0: header of 227 bytes, little-endian.
{
    printf 'LASF'
    head -c 20 /dev/zero
    printf '\1\2'
    head -c 64 /dev/zero
    printf '\1\0\1\0\343\0\343\0\0\0\0\0\0\0\0\24\0\1\0\0\0\1\0\0\0'
    head -c 16 /dev/zero
    for _ in x y z; do printf '\0\0\0\0\0\0\360\77'; done
    head -c 72 /dev/zero
    printf '\1\0\0\0\2\0\0\0\3\0\0\0'
    head -c 8 /dev/zero
} >"$work/las"
seed points las 3 <"$work/las"
seed points laz 4 <"$work/las"
seed frame_pixels pixels <<<$'frame,u,v,note\n0,16,12,crack\n000001.png,1.5,2.5,"a, b"'
printf '1 0 0 0\n0 1 0 0.1\n0 0 1 0\n0 0 0 1\n\0000 -1 0 1 1 0 0 2.5 0 0 1 -3\n' | seed matrix_folders two
seed frame_times times <<<$'0\n1\n2\n3'
seed frame_times names <<<$'0.5 000000.png\n1 000001.png\n2 000002.png\n3000000000000000 000003.png'
seed plan frames <<<$'frame,chainage_m,angle_deg,x_m,z_m\n0,0,350,0,0\n4,1,370,0.1,0'
seed plan times <<<$'time_s;chainage_m;angle_deg\n0;0;0\n2;1;90'
{
    printf 'GYROFLOW IMU LOG\nversion,1.3\norientation,YxZ\ntscale,0.001\ngscale,0.01\nascale,0.001\n'
    printf 'frame_readout_time,20\nframe_readout_direction,0\nt,gx,gy,gz,ax,ay,az\n'
    for ((k = 0; k < 600; k++)); do printf '%d,%d,%d,0,0,999,%d\n' $k $((k % 3)) $((k > 200 ? k / 9 : 0)) $((k % 2)); done
} >"$work/gyro"
for choice in 0 1 7 20 37; do
    seed gyro "log-$choice" "$(printf '%o' $choice)" <"$work/gyro"
done
mark='{"type": "Feature", "id": "a-1", "geometry": {"type": "Point", "coordinates": [1.5, 2.5]}, "properties": {"class": "BAB",
 "severity": 3, "note": "", "chainage_m": 2.5, "clock": "3:00", "theta_deg": 90, "x_m": 3, "y_m": 2.5, "z_m": 0, "end_chainage_m": 3,
 "end_clock": "4:00", "length_m": 0.5, "width_mm": 1.5, "layer": "refined", "created": "2020-01-01T00:00:00Z"}}'
seed marks one <<<"{\"type\": \"FeatureCollection\", \"features\": [$mark]}"
seed marks none <<<'{"type": "FeatureCollection", "features": []}'
request() { printf '%s HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nContent-Type: application/json\r\n%s\r\n' "$1" "${2:-}"; }
request 'GET /TOKEN/' | seed requests page
request 'GET /TOKEN/tile.webp' | seed requests tile
request 'HEAD /TOKEN/api/marks' | seed requests marks
request 'GET /TOKEN/api/frames/1' | seed requests frame
request 'GET /TOKEN/api/sightings?layer=initial&s=1.5&h=0.1' | seed requests sightings
{ request 'PUT /TOKEN/api/marks/a-1' "Content-Length: ${#mark}"$'\r\n'; printf %s "$mark"; } | seed requests put
request 'DELETE /TOKEN/api/marks/a-1' | seed requests delete
printf '\000A\001B\004C\010D\021E\002F\014G' | seed mark_changes all
printf 'frames/=a,"b"\n.png' | seed names odd
printf '000001.png' | seed names plain
printf '\000\173\024\256\107\341\172\204\077' | seed runs shift
seed video probed <<'END'
{"packets": [{"pts": 0, "flags": "K_"}, {"pts": 60, "flags": "__"}, {"pts": 20, "flags": "_D"}], "streams": [{"width": 64,
 "height": 48, "pix_fmt": "yuv420p", "time_base": "1/600", "field_order": "progressive", "side_data_list": [{"rotation": -90}]}]}
END
printf '5:black,18-20:missing,2:repeated' | seed words bad-frames
printf 'YxZ' | seed words orientation
printf '\000\000\000' | seed checkpoint empty 0
echo "seeds for: $(ls "$corpus" | tr '\n' ' ')"
