// Light from all around as the camera sees it (deferred_ir/scene/environment_image.py): latitude and longitude, the middle at
// -z and +x to its right, top row first, bilinear.

uniform vec3 environment_emission;  // factor on the image
uniform vec2 environment_turn;      // cosine and sine of its rotation about +y

vec3 environment_radiance(sampler2D environment, vec3 direction) {
    vec3 d = normalize(direction);
    d = vec3(environment_turn.x * d.x - environment_turn.y * d.z, d.y, environment_turn.x * d.z + environment_turn.y * d.x);
    ivec2 size = textureSize(environment, 0);
    vec2 at = vec2(atan(d.x, -d.z) / 6.28318531 + 0.5, acos(clamp(d.y, -1.0, 1.0)) / 3.14159265) * vec2(size) - 0.5;
    ivec2 corner = ivec2(floor(at));
    vec2 part = at - vec2(corner);
    vec3 rows[2];
    for (int i = 0; i < 2; ++i) {
        int y = clamp(corner.y + i, 0, size.y - 1);
        vec3 left = texelFetch(environment, ivec2((corner.x + size.x) % size.x, y), 0).rgb;
        vec3 right = texelFetch(environment, ivec2((corner.x + 1) % size.x, y), 0).rgb;
        rows[i] = mix(left, right, part.x);
    }
    return environment_emission * mix(rows[0], rows[1], part.y);
}
