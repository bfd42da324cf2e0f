"""What OpenGL runs for each vertex and each pixel (GLSL 3.30); see renderer.py.

Bodies come as instances: a unit mesh, placed by `at`, `turn` (a quaternion) and `size`, with a
texture whose repetition measures `repeat_m` (0: fitted to the face). Colours leave as BGR, the
order that OpenCV encodes.

What costs is what is done for each pixel. So what vertices can say they say, haze on bodies too;
llvmpipe would also read a uniform anew for each pixel, and look for a layer of a texture.
"""

from services.sim.textures import NET_COLOURS, NET_MESHES, NET_TAPE, NET_THREAD

SUN = (-0.42, -0.33, 0.845)
"""Towards it, world."""
HAZE = (0.78, 0.87, 0.93)
"""What far things fade into."""
HAZE_PER_M = 0.007

_HEAD = f"""
#version 330
const vec3 SUN = vec3{SUN};
"""

_PLACED = """
in vec3 in_position; in vec2 in_uv; in vec3 in_across; in vec3 in_up;
in vec3 at; in vec4 turn; in vec3 size; in vec2 repeat_m;
vec3 turned(vec3 v) { return v + 2.0 * cross(turn.xyz, cross(turn.xyz, v) + turn.w * v); }
vec3 placed() { return at + turned(in_position * size); }
vec2 uv_in_repeats() {
    vec2 side_m = vec2(dot(abs(in_across), size), dot(abs(in_up), size));
    return in_uv * vec2(repeat_m.x > 0.0 ? side_m.x / repeat_m.x : 1.0,
                        repeat_m.y > 0.0 ? side_m.y / repeat_m.y : 1.0);
}
"""

_HAZE = f"""
const vec3 HAZE = vec3{HAZE};
// By depth; an exponential would cost more than it shows.
float clear_at(float depth_m) {{ return 1.0 / (1.0 + {HAZE_PER_M} * depth_m); }}
"""

BODY_VERTEX = f"""{_HEAD}{_HAZE}{_PLACED}
uniform mat4 from_world;
in vec3 in_normal;
out vec2 uv; out float light; out float haze;
void main() {{
    vec3 normal = normalize(turned(in_normal / size));
    gl_Position = from_world * vec4(placed(), 1.0);
    float clear = clear_at(max(gl_Position.w, 0.0));
    light = clear * (0.50 + 0.12 * normal.z + 0.58 * max(dot(normal, SUN), 0.0));
    haze = 1.0 - clear;
    uv = uv_in_repeats();
}}
"""
BODY_FRAGMENT = f"""{_HEAD}{_HAZE}
uniform sampler2D skin;
in vec2 uv; in float light; in float haze;
out vec4 bgra;
void main() {{
    vec3 colour = texture(skin, uv).rgb;
    bgra = vec4((colour * light + HAZE * haze).bgr, 1.0);
}}
"""

# By rule, antialiased: to fetch a texel would take twice as long.
NET_FRAGMENT = f"""{_HEAD}{_HAZE}
in vec2 uv; in float light; in float haze;
out vec4 bgra;
void main() {{
    vec2 at = uv * vec2{NET_MESHES};
    vec2 from_thread = abs(fract(at + 0.5) - 0.5);
    vec2 pixel = fwidth(at);
    vec2 covered = clamp(({NET_THREAD / 2} - from_thread) / pixel + 0.5, 0.0, 1.0);
    // Of threads narrower than a pixel only their mean is seen.
    covered = mix(covered, vec2({NET_THREAD}), clamp(2.0 * pixel - 0.3, 0.0, 1.0));
    vec2 gap = 1.0 - covered;
    float tape = step({1.0 - NET_TAPE}, uv.y);
    vec3 colour = mix(vec3{NET_COLOURS[0]}, vec3{NET_COLOURS[1]}, tape);
    bgra = vec4((colour * light + HAZE * haze).bgr, max(tape, 1.0 - gap.x * gap.y));
}}
"""

# Seen from above through a window (corner, and 1 over its sides): how much light is left.
SHADOW_VERTEX = f"""{_HEAD}{_PLACED}
uniform vec4 window;
out vec2 uv;
void main() {{
    vec3 world = placed();
    vec2 fallen = world.xy - SUN.xy / SUN.z * max(world.z, 0.0);
    uv = uv_in_repeats();
    gl_Position = vec4((fallen - window.xy) * window.zw * 2.0 - 1.0, 0.0, 1.0);
}}
"""
SHADOW_FRAGMENT = """
#version 330
uniform sampler2D skin;
in vec2 uv;
out float shade;
void main() { shade = 0.8 - 0.4 * textureLod(skin, uv, 2.0).a; }
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

# The texture and the light both lie flat on the world.
_ON_GROUND = """
#version 330
uniform mat4 from_world;
uniform float height_m;
uniform vec2 moved_m;
uniform vec4 window;
in vec2 in_position;
out vec2 in_light;
vec2 placed() { return in_position + moved_m; }
void place() {
    in_light = (placed() - window.xy) * window.zw;
    gl_Position = from_world * vec4(placed(), height_m, 1.0);
}
"""
_LIT = f"""{_HAZE}
uniform sampler2D light;
in vec2 in_light;
vec3 lit(vec3 colour) {{
    float clear = gl_FragCoord.w / (gl_FragCoord.w + {HAZE_PER_M});
    return mix(HAZE, colour * (1.25 * texture(light, in_light).r), clear);
}}
"""
GROUND_VERTEX = f"""{_ON_GROUND}
uniform vec2 per_m;
out vec2 uv;
void main() {{
    place();
    uv = placed() * per_m;
}}
"""
GROUND_FRAGMENT = f"""
#version 330
{_LIT}
uniform sampler2D paving;
in vec2 uv;
out vec4 bgra;
void main() {{ bgra = vec4(lit(texture(paving, uv).rgb).bgr, 1.0); }}
"""

# Apart from textures, since `discard` makes all that a program draws dearer.
PAINT_VERTEX = f"""{_ON_GROUND}
uniform vec3 tint;
uniform float dashes_per_m;
in float in_along_m;
out float dashes; flat out vec3 colour;
void main() {{
    place();
    dashes = in_along_m * dashes_per_m;
    colour = tint;
}}
"""
PAINT_FRAGMENT = f"""
#version 330
{_LIT}
in float dashes; flat in vec3 colour;
out vec4 bgra;
void main() {{
    if (fract(dashes) > 0.5) discard;
    bgra = vec4(lit(colour).bgr, 1.0);
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
