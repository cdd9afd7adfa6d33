// Depths brought into −1 … 1 over the depths of a scene, by their logarithms (src/methods/common/warp.rs).

fn warped(depth: f32) -> f32 {
    let near = method.nearest;
    let far = method.farthest;
    let z = clamp(depth, near, far);
    var share_of = vec2f(z - near, far - near);
    if near > 0.0 {
        share_of = vec2f(log(z / near), log(far / near));
    }
    if share_of.y > 0.0 {
        return clamp(2.0 * (share_of.x / share_of.y) - 1.0, -1.0, 1.0);
    }
    return 0.0;
}
