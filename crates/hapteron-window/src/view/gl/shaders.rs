//! The shaders, in the common part of GLSL 3.30 and GLSL ES 3.00. Colours are mixed in linear light and written as sRGB.

/// Shaded or plainly coloured triangles.
pub const SURFACE_VERTEX: &str = "
layout(location = 0) in vec3 a_position;
layout(location = 1) in vec3 a_normal;
layout(location = 2) in vec4 a_colour;
uniform mat4 u_clip_from_world;
uniform mat4 u_world_from_mesh;
out vec3 v_position;
out vec3 v_normal;
out vec4 v_colour;
void main() {
    vec4 world = u_world_from_mesh * vec4(a_position, 1.0);
    v_position = world.xyz;
    v_normal = mat3(u_world_from_mesh) * a_normal;
    v_colour = a_colour;
    gl_Position = u_clip_from_world * world;
}
";

/// Two lights that travel with the camera, some light from the sky, a soft highlight.
pub const SURFACE_FRAGMENT: &str = "
in vec3 v_position;
in vec3 v_normal;
in vec4 v_colour;
uniform vec3 u_eye;
uniform vec3 u_key;
uniform vec3 u_fill;
uniform vec4 u_inside;
uniform vec4 u_colour;
uniform float u_shaded;
out vec4 o_colour;
void main() {
    vec4 colour = u_colour * v_colour;
    if (u_shaded < 0.5) {
        o_colour = colour;
        return;
    }
    vec3 n = normalize(v_normal);
    if (!gl_FrontFacing) {
        n = -n;
        colour.rgb = u_inside.rgb;
    }
    vec3 to_eye = normalize(u_eye - v_position);
    float sky = 0.17 + 0.07 * n.z;
    float diffuse = sky + 0.66 * max(dot(n, u_key), 0.0) + 0.2 * max(dot(n, u_fill), 0.0);
    // Powers of 32 and 4 by squaring: where the processor draws, pow() is slow.
    float shine = max(dot(n, normalize(u_key + to_eye)), 0.0);
    shine *= shine;
    shine *= shine;
    shine *= shine;
    shine *= shine;
    shine *= shine;
    float rim = 1.0 - max(dot(n, to_eye), 0.0);
    rim *= rim;
    rim *= rim;
    vec3 linear = colour.rgb * colour.rgb * (diffuse + 0.12 * rim) + 0.14 * shine;
    o_colour = vec4(sqrt(clamp(linear, 0.0, 1.0)), colour.a);
}
";

/// Spans a rectangle around each stroke, in pixels of the screen.
pub const STROKE_VERTEX: &str = "
layout(location = 0) in vec3 a_from;
layout(location = 1) in vec3 a_to;
layout(location = 2) in vec4 a_colour;
layout(location = 3) in float a_width;
uniform mat4 u_clip_from_world;
uniform mat4 u_world_from_local;
uniform vec3 u_eye;
uniform vec2 u_size;
uniform float u_scale;
uniform float u_lift;
uniform vec4 u_tint;
out vec2 v_place;
flat out float v_length;
flat out float v_radius;
flat out vec4 v_colour;
vec4 lifted(vec3 local) {
    vec3 world = (u_world_from_local * vec4(local, 1.0)).xyz;
    return u_clip_from_world * vec4(mix(world, u_eye, u_lift), 1.0);
}
void main() {
    vec4 a = lifted(a_from);
    vec4 b = lifted(a_to);
    const float nearest = 1e-5;
    v_colour = a_colour * u_tint;
    v_radius = max(0.5 * a_width * u_scale, 0.5);
    v_length = 0.0;
    v_place = vec2(0.0);
    if (a.w < nearest && b.w < nearest) {
        gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
        return;
    }
    if (a.w < nearest) a = mix(a, b, (nearest - a.w) / (b.w - a.w));
    if (b.w < nearest) b = mix(b, a, (nearest - b.w) / (a.w - b.w));
    vec2 pa = a.xy / a.w * 0.5 * u_size;
    vec2 pb = b.xy / b.w * 0.5 * u_size;
    vec2 along = pb - pa;
    v_length = length(along);
    along = v_length > 1e-4 ? along / v_length : vec2(1.0, 0.0);
    vec2 across = vec2(-along.y, along.x);
    float reach = v_radius + 1.0;
    bool end = gl_VertexID >= 2;
    float side = (gl_VertexID & 1) == 0 ? -reach : reach;
    v_place = vec2(end ? v_length + reach : -reach, side);
    vec2 place = (end ? pb + along * reach : pa - along * reach) + across * side;
    vec4 clip = end ? b : a;
    gl_Position = vec4(place / (0.5 * u_size) * clip.w, clip.z, clip.w);
}
";

/// Round ends and smooth edges.
pub const STROKE_FRAGMENT: &str = "
in vec2 v_place;
flat in float v_length;
flat in float v_radius;
flat in vec4 v_colour;
out vec4 o_colour;
void main() {
    float beyond = v_place.x - clamp(v_place.x, 0.0, v_length);
    float distance = length(vec2(beyond, v_place.y));
    float cover = clamp(v_radius + 0.5 - distance, 0.0, 1.0);
    if (cover <= 0.0) discard;
    o_colour = vec4(v_colour.rgb, v_colour.a * cover);
}
";

/// A triangle that covers the picture.
pub const BACKDROP_VERTEX: &str = "
out float v_height;
void main() {
    vec2 corner = vec2(float((gl_VertexID << 1) & 2), float(gl_VertexID & 2));
    v_height = corner.y;
    gl_Position = vec4(corner * 2.0 - 1.0, 0.0, 1.0);
}
";

/// From one colour to another.
pub const BACKDROP_FRAGMENT: &str = "
in float v_height;
uniform vec4 u_top;
uniform vec4 u_bottom;
out vec4 o_colour;
void main() {
    o_colour = vec4(mix(u_bottom.rgb, u_top.rgb, v_height), 1.0);
}
";
