// The ray march pass that shaders/glsl_to_es.py makes at build time.
declare module "voxeld-shaders/raymarch.es.glsl" {
  const text: string;
  export default text;
}
