# The image for amd64 and arm64: `docker buildx bake -f docker/bake.hcl --push`, with NAME=registry/name:tag.
variable "NAME" {
  default = "holozen"
}

target "default" {
  context    = "."
  dockerfile = "docker/Dockerfile"
  tags       = [NAME]
  platforms  = ["linux/amd64", "linux/arm64"]
}
