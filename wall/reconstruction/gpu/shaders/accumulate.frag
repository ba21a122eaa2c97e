// The value of a sample, for its own pixel.
flat in vec4 value;
out vec4 sum;

void main() { sum = value; }
