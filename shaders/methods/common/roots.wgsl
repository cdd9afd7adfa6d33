// The HALF roots of a polynomial that has real roots alone, of degree 2 to 4 (src/methods/common/roots.rs).

// Coefficients, the leading one first; behind the last of its degree, 0.
struct Polynomial {
    first: vec4f,
    last: f32,
}

// 1/x of an outermost root x, by Laguerre's method from 0.
fn outermost(c: Polynomial, degree: f32) -> f32 {
    let less = degree - 1.0;
    let four = 4.0 * c.last;
    let six = 6.0 * c.last;
    var y = 0.0;
    for (var i = 0u; i < ROOT_STEPS; i++) {
        let p = (((c.last * y + c.first.w) * y + c.first.z) * y + c.first.y) * y + c.first.x;
        let slope = ((four * y + 3.0 * c.first.w) * y + 2.0 * c.first.z) * y + c.first.y;
        let half_bend = (six * y + 3.0 * c.first.w) * y + c.first.z;
        let root = sqrt(max(0.0, less * (less * slope * slope - 2.0 * degree * p * half_bend)));
        let below = select(slope + root, slope - root, slope < 0.0);
        if below != 0.0 {
            // Bounded, so that fourth powers are.
            y = clamp(y - degree * p / below, -1e5, 1e5);
        }
    }
    return y;
}

// Divided by 1 − y x, from the constant term on: stable where 1/y is the root of greatest magnitude.
fn without(c: Polynomial, y: f32) -> Polynomial {
    let d3 = c.last;
    let d2 = c.first.w + y * d3;
    let d1 = c.first.z + y * d2;
    return Polynomial(vec4f(c.first.y + y * d1, d1, d2, d3), 0.0);
}

fn inverse(y: f32) -> f32 {
    if abs(y) * FAR_ROOT > 1.0 {
        return 1.0 / y;
    }
    return select(FAR_ROOT, -FAR_ROOT, y < 0.0);
}

// Of a x² + b x + c, without the difference of b and the discriminant's root.
fn quadratic(a: f32, b: f32, c: f32) -> vec2f {
    let root = sqrt(max(0.0, b * b - 4.0 * a * c));
    let t = -0.5 * select(b + root, b - root, b < 0.0);
    if abs(t) < 1e-20 {
        return vec2f(0.0);
    }
    return vec2f(inverse(a / t), clamp(c / t, -FAR_ROOT, FAR_ROOT));
}

// In no order, FAR_ROOT where there is none.
fn real_roots(coefficients: Polynomial) -> vec4f {
    let sizes = max(abs(coefficients.first), vec4f(abs(coefficients.last)));
    let greatest = max(1e-30, max(max(sizes.x, sizes.y), max(sizes.z, sizes.w)));
    var c = Polynomial(coefficients.first / greatest, coefficients.last / greatest);
    var roots = vec4f(FAR_ROOT);
    if HALF > 3u {
        let y = outermost(c, 4.0);
        roots.w = inverse(y);
        c = without(c, y);
    }
    if HALF > 2u {
        let y = outermost(c, 3.0);
        roots.z = inverse(y);
        c = without(c, y);
    }
    let two = quadratic(c.first.x, c.first.y, c.first.z);
    return vec4f(two, roots.zw);
}
