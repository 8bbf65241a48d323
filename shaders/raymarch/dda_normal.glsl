// The direction in which a cloud of points is thinnest, from its moments.

// Sums over points: their number, coordinates, squares (xx, yy, zz) and products (xy, xz, yz).
struct Moments {
  float count;
  vec3 sum, squares, products;
};

// Unit eigenvector of the smallest eigenvalue of the points' covariance matrix: surface normals by
// principal components (Hoppe et al., "Surface Reconstruction from Unorganized Points", 1992). The
// matrix is 3x3 and only one vector is needed, so eigenvalues are not solved for. Instead the
// adjugate, whose dominant eigenvector is the same vector, is squared three times. Zero vector: the
// points lie in a line, or all directions are alike.
vec3 thinnest_direction(Moments m) {
  vec3 mean = m.sum / m.count;
  vec3 d = m.squares / m.count - mean * mean;
  vec3 o = m.products / m.count -
           vec3(mean.x, mean.x, mean.y) * vec3(mean.y, mean.z, mean.z);
  mat3 adjugate =
      mat3(d.y * d.z - o.z * o.z, o.y * o.z - o.x * d.z, o.x * o.z - o.y * d.y,
           o.y * o.z - o.x * d.z, d.x * d.z - o.y * o.y, o.x * o.y - o.z * d.x,
           o.x * o.z - o.y * d.y, o.x * o.y - o.z * d.x, d.x * d.y - o.x * o.x);
  float trace = adjugate[0][0] + adjugate[1][1] + adjugate[2][2];
  if (!(trace > 1e-4f)) return vec3(0.0f);
  adjugate /= trace;
  for (int i = 0; i < 3; ++i) {
    adjugate = adjugate * adjugate;
    adjugate /= adjugate[0][0] + adjugate[1][1] + adjugate[2][2];
  }
  vec3 diagonal = vec3(adjugate[0][0], adjugate[1][1], adjugate[2][2]);
  if (diagonal.x >= diagonal.y && diagonal.x >= diagonal.z) return normalize(adjugate[0]);
  return normalize(diagonal.y >= diagonal.z ? adjugate[1] : adjugate[2]);
}
