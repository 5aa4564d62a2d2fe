// A picture leads to its file, in which it can be enlarged.
for (const picture of document.querySelectorAll("article img")) {
  if (!picture.closest("a")) {
    const link = document.createElement("a");
    link.href = picture.src;
    picture.replaceWith(link);
    link.append(picture);
  }
}
