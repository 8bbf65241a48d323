// Correctly rounded quotients of doubles from additions and multiplications, because GLSL lets a
// division be off by some last bits. Products and quotients must be far from both ends of double's
// range; otherwise the result may be anything, NaN included.

// The rounding error of a product: a * b - product, exactly (Dekker 1971, "A floating-point
// technique for extending the available precision"). product: a * b, rounded.
double product_error(double a, double b, double product) {
  // 2^27 + 1 splits 53 bits into two halves, whose products are exact.
  precise double a_wide = double(134217729) * a, b_wide = double(134217729) * b;
  precise double a_high = a_wide - (a_wide - a), b_high = b_wide - (b_wide - b);
  precise double a_low = a - a_high, b_low = b - b_high;
  precise double error = a_high * b_high - product;
  error = error + a_high * b_low;
  error = error + a_low * b_high;
  error = error + a_low * b_low;
  return error;
}

// The remainder a - b * quotient, exact for the two doubles around a / b.
double rest_of(double a, double b, double quotient) {
  precise double product = b * quotient;
  precise double rest = a - product;
  rest = rest - product_error(b, quotient, product);
  return rest;
}

// The quotient a / b for b > 0. reciprocal: 1 / b, rounded. After one Newton step the quotient is
// the double above or below the exact one. If the other may be nearer, the exact remainders decide.
// They cannot be equal: no quotient of doubles lies in the middle of two.
double divided(double a, double b, double reciprocal) {
  precise double quotient = a * reciprocal;
  quotient = quotient + rest_of(a, b, quotient) * reciprocal;
  precise double rest = rest_of(a, b, quotient);
  // One and a half steps reach the other double whenever that may be nearer.
  precise double other = quotient + rest * reciprocal * double(1.5);
  precise double other_rest = rest_of(a, b, other);
  return abs(other_rest) < abs(rest) ? other : quotient;
}
