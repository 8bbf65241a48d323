// A visit of the cells that a triangle touches in a block of columns, for every pass over
// (triangle, cell) pairs. The including file must define the two functions that are declared here.

// Called before the cells of column (i, j); s = touch_height(t, i, j).
void begin_column(TouchTriangle t, int i, int j);
// Called for each touched cell (i, j, k) of the current column; k ascends.
void visit_cell(int i, int j, int k);

// low, high: estimates for touch_depth.
void visit_column(TouchTriangle t, int i, int j, TOUCH_INT s, float low, float high) {
  if (!touch_column(t, i, j)) return;
  ivec2 depth = touch_depth(t, s, low, high);
  begin_column(t, i, j);
  for (int k = depth.x; k <= depth.y; ++k) {
    if (touch_sides(t, i, j, k)) visit_cell(i, j, k);
  }
}

// Visits columns [first, last] in both directions.
void visit_block(TouchTriangle t, ivec2 first, ivec2 last) {
  float slope = -touch_float(t.normal.x) * t.inverse_z;
  for (int j = first.y; j <= last.y; ++j) {
    ivec2 span = touch_row_span(t, j, first.x, last.x);
    TOUCH_INT s = touch_height(t, span.x, j);
    float low = touch_low(t, s);
    float high = touch_high(t, s);
    for (int i = span.x; i <= span.y; ++i) {
      float at = slope * float(i - span.x);
      visit_column(t, i, j, s, low + at, high + at);
      s = touch_plus(s, t.normal.x);
    }
  }
}

void visit_one_column(TouchTriangle t, int i, int j) {
  TOUCH_INT s = touch_height(t, i, j);
  visit_column(t, i, j, s, touch_low(t, s), touch_high(t, s));
}
