// A library that opens but lacks most of the vendor's functions.
extern "C" {
void* virtOpen(const char*) {
  return nullptr;
}
int virtClose(void*) {
  return -1;
}
}
