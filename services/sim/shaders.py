"""What OpenGL runs for each vertex and each pixel (GLSL 3.30); see renderer.py.

Bodies come as instances: a unit mesh, placed by `at`, `turn` (a quaternion) and `size`, with a
texture of a layer whose repetition measures `extent` m (0: fitted to the face). Colours leave as
BGR, the order that OpenCV encodes.
"""

from services.sim.textures import NET_COLOURS, NET_MESHES, NET_TAPE, NET_THREAD

SUN = (-0.42, -0.33, 0.845)
"""Towards it, world."""
MAX_LAYERS = 16
HAZE = (0.78, 0.87, 0.93)
"""What far things fade into."""
HAZE_PER_M = 0.007

_HEAD = f"""
#version 330
const vec3 SUN = vec3{SUN};
const int MAX_LAYERS = {MAX_LAYERS};
"""

_PLACED = """
uniform vec2 extent[MAX_LAYERS];
in vec3 in_position; in vec2 in_uv; in vec3 in_across; in vec3 in_up;
in vec3 at; in vec4 turn; in vec3 size; in float layer;
vec3 turned(vec3 v) { return v + 2.0 * cross(turn.xyz, cross(turn.xyz, v) + turn.w * v); }
vec3 placed() { return at + turned(in_position * size); }
vec3 uv_in_repeats() {
    vec2 side_m = vec2(dot(abs(in_across), size), dot(abs(in_up), size));
    vec2 repeat_m = extent[int(layer)];
    vec2 repeats = vec2(repeat_m.x > 0.0 ? side_m.x / repeat_m.x : 1.0,
                        repeat_m.y > 0.0 ? side_m.y / repeat_m.y : 1.0);
    return vec3(in_uv * repeats, layer);
}
"""

_HAZE = f"""
const vec3 HAZE = vec3{HAZE};
// By depth; an exponential would cost more than it shows.
vec3 hazy(vec3 colour) {{
    return mix(HAZE, colour, 1.0 / (1.0 + {HAZE_PER_M} / gl_FragCoord.w));
}}
"""

BODY_VERTEX = f"""{_HEAD}{_PLACED}
uniform mat4 from_world;
in vec3 in_normal;
out vec3 uv; out float light;
void main() {{
    vec3 normal = normalize(turned(in_normal / size));
    light = 0.50 + 0.12 * normal.z + 0.58 * max(dot(normal, SUN), 0.0);
    uv = uv_in_repeats();
    gl_Position = from_world * vec4(placed(), 1.0);
}}
"""
BODY_FRAGMENT = f"""{_HEAD}{_HAZE}
uniform sampler2DArray textures;
in vec3 uv; in float light;
out vec4 bgra;
void main() {{
    vec4 texel = texture(textures, uv);
    bgra = vec4(hazy(texel.rgb * light).bgr, texel.a);
}}
"""

# By rule, antialiased: to fetch a texel would take twice as long.
NET_FRAGMENT = f"""{_HEAD}{_HAZE}
in vec3 uv; in float light;
out vec4 bgra;
void main() {{
    vec2 at = uv.xy * vec2{NET_MESHES};
    vec2 from_thread = abs(fract(at + 0.5) - 0.5);
    vec2 pixel = fwidth(at);
    vec2 covered = clamp(({NET_THREAD / 2} - from_thread) / pixel + 0.5, 0.0, 1.0);
    // Of threads narrower than a pixel only their mean is seen.
    covered = mix(covered, vec2({NET_THREAD}), clamp(2.0 * pixel - 0.3, 0.0, 1.0));
    vec2 gap = 1.0 - covered;
    float tape = step({1.0 - NET_TAPE}, uv.y);
    vec3 colour = mix(vec3{NET_COLOURS[0]}, vec3{NET_COLOURS[1]}, tape);
    bgra = vec4(hazy(colour * light).bgr, max(tape, 1.0 - gap.x * gap.y));
}}
"""

# Seen from above through a window (corner, and 1 over its sides): how much light is left.
SHADOW_VERTEX = f"""{_HEAD}{_PLACED}
uniform vec4 window;
out vec3 uv;
void main() {{
    vec3 world = placed();
    vec2 fallen = world.xy - SUN.xy / SUN.z * max(world.z, 0.0);
    uv = uv_in_repeats();
    gl_Position = vec4((fallen - window.xy) * window.zw * 2.0 - 1.0, 0.0, 1.0);
}}
"""
SHADOW_FRAGMENT = """
#version 330
uniform sampler2DArray textures;
in vec3 uv;
out float shade;
void main() { shade = 0.8 - 0.4 * textureLod(textures, uv, 2.0).a; }
"""
PATCHES_VERTEX = """
#version 330
in vec2 corner;
out vec2 at;
void main() { at = corner; gl_Position = vec4(corner, 0.0, 1.0); }
"""
PATCHES_FRAGMENT = """
#version 330
uniform sampler2D patches;
in vec2 at;
out float shade;
void main() {
    // Even at the edges, which go on for ever.
    vec2 inside = clamp((1.0 - abs(at)) * 8.0, 0.0, 1.0);
    shade = 0.8 + (texture(patches, at * 1.7).r - 0.5) * 0.26 * inside.x * inside.y;
}
"""

# `at` is the place on the ground, world, in m: the texture and the light both lie flat on it.
GROUND_VERTEX = """
#version 330
uniform mat4 from_world;
uniform float height_m;
in vec2 in_position;
out vec2 at;
void main() {
    at = in_position;
    gl_Position = from_world * vec4(in_position, height_m, 1.0);
}
"""
_LIT = """
uniform sampler2D light;
uniform vec4 window;
in vec2 at;
float lit() { return texture(light, (at - window.xy) * window.zw).r * 1.25; }
"""
GROUND_FRAGMENT = f"""{_HEAD}{_HAZE}{_LIT}
uniform sampler2DArray textures;
uniform float layer;
uniform vec2 per_m;
out vec4 bgra;
void main() {{
    vec3 colour = texture(textures, vec3(at * per_m, layer)).rgb;
    bgra = vec4(hazy(colour * lit()).bgr, 1.0);
}}
"""

# Apart from textures, since `discard` makes all that a program draws dearer.
PAINT_VERTEX = """
#version 330
uniform mat4 from_world;
uniform float height_m;
in vec2 in_position; in float in_along_m;
out vec2 at; out float along_m;
void main() {
    at = in_position;
    along_m = in_along_m;
    gl_Position = from_world * vec4(in_position, height_m, 1.0);
}
"""
PAINT_FRAGMENT = f"""{_HEAD}{_HAZE}{_LIT}
uniform vec3 tint;
uniform float dash_m;
in float along_m;
out vec4 bgra;
void main() {{
    if (dash_m > 0.0 && fract(along_m / (2.0 * dash_m)) > 0.5) discard;
    bgra = vec4(hazy(tint * lit()).bgr, 1.0);
}}
"""

SKY_VERTEX = """
#version 330
uniform mat4 from_world;
uniform vec3 eye;
uniform float slope;
in vec3 in_position; in vec3 in_colour;
out vec3 colour;
void main() {
    colour = in_colour.bgr;
    vec3 away = in_position;
    // Its rim lies on the ground: what is hidden costs too.
    if (away.z < 0.0) away.z *= slope;
    // As far as depth goes.
    gl_Position = (from_world * vec4(eye + away * 100.0, 1.0)).xyww;
}
"""
SKY_FRAGMENT = """
#version 330
in vec3 colour;
out vec4 bgra;
void main() { bgra = vec4(colour, 1.0); }
"""
