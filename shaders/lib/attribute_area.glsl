// The intersection of a triangle and a cell, seen along the cell's column and measured on rows
// across it: on each row the intersection is an interval, because it is convex. All are integers.
// Positions have x and y from 0 to 4096, in 2^-12 cells from the column's corner.

#define AREA_SIDE 4096
#define AREA_ROWS 8
// The area of a cell's face.
#define AREA_FACE 32768
#define AREA_FACE_BITS 15

// A line a x + b y + c = 0 with a >= 0, without the constant, which differs by column. a and b have
// up to 15 bits.
struct RowLine {
  int b;
  int span;         // a * AREA_SIDE, at least 1
  int shift;        // span >> shift has up to 16 bits
  uint reciprocal;  // 2^31 / (span >> shift), rounded up
};

RowLine row_line(int a, int b) {
  RowLine line;
  line.b = b;
  line.span = max(a * AREA_SIDE, 1);
  line.shift = max(findMSB(uint(line.span)) - 15, 0);
  uint divisor = uint(line.span >> line.shift);
  line.reciprocal = (0x80000000u + divisor - 1u) / divisor;
  return line;
}

// The x, from 0 to AREA_SIDE, where the line crosses the row at y. constant: c of the column, below
// 2^30 in size. A line along the row is at 0 if its value there is not negative, else at AREA_SIDE.
int row_crossing(RowLine line, int constant, int y) {
  int rest = -(line.b * y + constant);
  return int(((uint(clamp(rest, 0, line.span)) >> line.shift) * line.reciprocal) >> 19);
}

// The rows of a column divide the part of it that the triangle's box covers into bands of
// equal height. An interval has the first x in the lower half of a word and the last in the upper
// one. It is empty where the last is not larger.
struct ColumnRows {
  int low;      // y of the part
  int spacing;  // half of a band's height; 256 for the whole column
  uint rows[AREA_ROWS];
};

int row_y(ColumnRows column, int r) { return column.low + column.spacing * (2 * r + 1); }

// low, high: y of the box in the column, multiples of 16, maybe beyond it.
ColumnRows box_rows(int low, int high) {
  ColumnRows column;
  column.low = clamp(low, 0, AREA_SIDE);
  column.spacing = max(min(high, AREA_SIDE) - column.low, 0) >> 4;
  for (int r = 0; r < AREA_ROWS; ++r) column.rows[r] = uint(AREA_SIDE) << 16;
  return column;
}

// Keeps the part with x >= the crossing if is_right, else the other part.
ColumnRows clip_rows(ColumnRows column, RowLine line, int constant, bool is_right) {
  for (int r = 0; r < AREA_ROWS; ++r) {
    int x = row_crossing(line, constant, row_y(column, r));
    int first = int(column.rows[r] & 0xffffu), last = int(column.rows[r] >> 16);
    if (is_right) {
      first = max(first, x);
    } else {
      last = min(last, x);
    }
    column.rows[r] = uint(first) | uint(last) << 16;
  }
  return column;
}

// Sums over rows, l being the length of a row's interval and m the sum of its ends.
struct RowSums {
  uint lengths;  // of l
  uint x;        // of l m
  uint y;        // of l (2 r + 1)
  uint squares;  // of l l
};

// Strips of rows, from the lowest.
#define AREA_STRIPS 4
#define AREA_STRIP_ROWS (AREA_ROWS / AREA_STRIPS)
struct CellArea {
  int low, spacing;  // of the column's rows
  RowSums strips[AREA_STRIPS];
};

RowSums no_rows() {
  RowSums none;
  none.lengths = none.x = none.y = none.squares = 0u;
  return none;
}

RowSums add_row(RowSums sums, int first, int last, int r) {
  uint l = uint(max(last - first, 0));
  sums.lengths += l;
  sums.x += l * uint(first + last);
  sums.y += l * uint(2 * r + 1);
  sums.squares += l * l;
  return sums;
}

RowSums all_rows(CellArea cell) {
  RowSums all = no_rows();
  for (int n = 0; n < AREA_STRIPS; ++n) {
    all.lengths += cell.strips[n].lengths;
    all.x += cell.strips[n].x;
    all.y += cell.strips[n].y;
  }
  return all;
}

// The area of rows; a face has AREA_FACE.
uint rows_area(CellArea cell, RowSums sums) { return (sums.lengths * uint(cell.spacing)) >> 8; }

// The lengths must not be 0.
ivec2 row_centroid(CellArea cell, RowSums sums) {
  return ivec2(int(sums.x / (2u * sums.lengths)),
               cell.low + int(sums.y * uint(cell.spacing) / sums.lengths));
}

// Half of the distance in x between the centroids of the left and the right halves of all rows. The
// lengths must not be 0.
int row_spread(RowSums sums) { return int(sums.squares / (4u * sums.lengths)); }
