// The depth that a window of a perspective has, from the nearest to the farthest (src/methods/common/window.rs).

// 0 at the nearest and 1 at the farthest, as 1/z goes; 0 where the range is empty.
fn window_depth(z: f32) -> f32 {
    let near = method.nearest;
    let far = method.farthest;
    if far > near && z > max(near, 0.0) {
        return clamp((z - near) / z * (far / (far - near)), 0.0, 1.0);
    }
    return 0.0;
}
