flat in vec4 value;
out vec4 gathered;

void main() { gathered = value; }
