//! Sixteen elements at a time: the vector type of the element and embedding kernels, and small dense algebra on it.

/// Sixteen `f32` lanes; two AVX2 or one AVX-512 register.
pub(crate) type F = wide::f32x16;

/// Lanes of [`F`].
pub(crate) const LANES: usize = 16;

/// A 3-vector per lane.
pub(crate) type Vec3 = [F; 3];

/// A row-major 3x3 matrix per lane.
pub(crate) type Mat3 = [[F; 3]; 3];

#[inline(always)]
pub(crate) fn dot(a: Vec3, b: Vec3) -> F {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

#[inline(always)]
pub(crate) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1].mul_sub(b[2], a[2] * b[1]), a[2].mul_sub(b[0], a[0] * b[2]), a[0].mul_sub(b[1], a[1] * b[0])]
}

/// `m v`
#[inline(always)]
pub(crate) fn mul(m: &Mat3, v: Vec3) -> Vec3 {
    [dot(m[0], v), dot(m[1], v), dot(m[2], v)]
}

/// `m^T v`
#[inline(always)]
pub(crate) fn mul_transpose(m: &Mat3, v: Vec3) -> Vec3 {
    [
        m[0][0].mul_add(v[0], m[1][0].mul_add(v[1], m[2][0] * v[2])),
        m[0][1].mul_add(v[0], m[1][1].mul_add(v[1], m[2][1] * v[2])),
        m[0][2].mul_add(v[0], m[1][2].mul_add(v[1], m[2][2] * v[2])),
    ]
}

/// Nodal vectors are padded to four floats so that a node is one aligned load.
pub(crate) type Node = [f32; 4];

/// Loads the three components of sixteen nodes.
#[inline(always)]
pub(crate) fn gather(nodes: &[Node], idx: &[u32; LANES]) -> Vec3 {
    let (mut x, mut y, mut z) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    for lane in 0..LANES {
        let n = &nodes[idx[lane] as usize];
        (x[lane], y[lane], z[lane]) = (n[0], n[1], n[2]);
    }
    [F::new(x), F::new(y), F::new(z)]
}

/// Adds three components to sixteen nodes, lane after lane, as lanes may share a node.
#[inline(always)]
pub(crate) fn scatter_add(nodes: &mut [Node], idx: &[u32; LANES], v: Vec3) {
    let (x, y, z) = (v[0].to_array(), v[1].to_array(), v[2].to_array());
    for lane in 0..LANES {
        let n = &mut nodes[idx[lane] as usize];
        n[0] += x[lane];
        n[1] += y[lane];
        n[2] += z[lane];
    }
}
